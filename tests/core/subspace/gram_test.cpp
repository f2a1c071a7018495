#include "core/subspace/gram.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/simd/targets.h"
#include "core/subspace/memory_source.h"
#include "core/subspace/solver.h"
#include "tests/core/subspace/subspace_samples.h"
#include "tests/support/byte_source.h"

namespace eigenpose {
namespace {

/// The same views through a source that must be read.
class StreamedSource final : public AppearanceSource {
 public:
  explicit StreamedSource(const AppearanceSource& inner) : inner_(inner) {}
  [[nodiscard]] std::size_t count() const override { return inner_.count(); }
  [[nodiscard]] std::size_t length() const override { return inner_.length(); }
  [[nodiscard]] bool has_bytes() const override { return inner_.has_bytes(); }
  void read(std::size_t first, Eigen::Ref<Eigen::MatrixXf> tile) const override { inner_.read(first, tile); }
  void read_bytes(std::size_t first, std::size_t n, std::uint8_t* tile) const override {
    inner_.read_bytes(first, n, tile);
  }

 private:
  const AppearanceSource& inner_;
};

TEST(Gram, IsTheExactInnerProductsOfBytes) {
  // 201 views: two full tiles and a part; 1300 numbers: one full k-block and a part.
  const auto bytes = test::smooth_views(201, 1300, 1);
  const ByteSource source(bytes, 1300);
  const Eigen::MatrixXd gram = gram_matrix(source, {});
  for (const auto& [i, j] : {std::pair{0, 0}, {200, 3}, {3, 200}, {100, 99}, {95, 96}}) {
    std::int64_t expected = 0;
    for (std::size_t k = 0; k < 1300; ++k) {
      expected +=
          bytes[static_cast<std::size_t>(i) * 1300 + k] * bytes[static_cast<std::size_t>(j) * 1300 + k];
    }
    EXPECT_EQ(gram(i, j), static_cast<double>(expected)) << i << ' ' << j;
  }
  EXPECT_EQ(gram, gram.transpose());
}

TEST(Gram, IsTheSameBitForBitWithAnyThreadsTilesAndInstructions) {
  const auto bytes = test::smooth_views(210, 1111, 2);
  const ByteSource byte_source(bytes, 1111);
  const FloatSource float_source(test::views_of_rank(1111, 210, 20, 3));
  for (const AppearanceSource* source : {static_cast<const AppearanceSource*>(&byte_source),
                                         static_cast<const AppearanceSource*>(&float_source)}) {
    const Eigen::MatrixXd one = gram_matrix(*source, {1, 0});
    EXPECT_EQ(one, gram_matrix(*source, {3, 0})) << "threads";
    for (const std::string& target : simd_targets()) {
      const OnlySimdTarget only(target);
      EXPECT_EQ(one, gram_matrix(*source, {2, 0})) << target;
    }
    const StreamedSource streamed(*source);
    EXPECT_EQ(one, gram_matrix(streamed, {2, 0})) << "read whole";
    EXPECT_EQ(one, gram_matrix(streamed, {2, 1111 * 4 * 60})) << "read in tiles";
    EXPECT_EQ(one, gram_matrix(streamed, {2, 1111 * 4 * 2})) << "read two views at a time";
  }
}

/// Objects of a set as [first, last) of its views.
using Parts = std::vector<std::pair<std::size_t, std::size_t>>;

/// The views of `parts`, one part after the other.
std::vector<std::uint8_t> chosen(const std::vector<std::uint8_t>& bytes, std::size_t length,
                                 const Parts& parts) {
  std::vector<std::uint8_t> result;
  for (const auto& [first, last] : parts)
    result.insert(result.end(), bytes.begin() + static_cast<std::ptrdiff_t>(first * length),
                  bytes.begin() + static_cast<std::ptrdiff_t>(last * length));
  return result;
}

/// Where views [0, known) of the whole set are known: their rows among `parts`.
KnownProducts known_of(const Eigen::MatrixXd& whole, Eigen::Index known, const Parts& parts) {
  KnownProducts result{whole.topLeftCorner(known, known), {}};
  for (const auto& [first, last] : parts)
    for (auto i = static_cast<Eigen::Index>(first); i < static_cast<Eigen::Index>(last); ++i)
      result.rows.push_back(i < known ? i : -1);
  return result;
}

TEST(KnownProducts, GiveTheEigenspaceThatIsLearnedAnewBitForBit) {
  constexpr std::size_t length = 300;
  const auto all = test::smooth_views(400, length, 1);
  const Eigen::MatrixXd whole = gram_matrix(ByteSource(all, length), {});
  const Parts joined_last = {{0, 150}, {150, 300}, {300, 400}};
  const Parts joined_between = {{0, 150}, {300, 400}, {150, 300}};
  const Parts left = {{0, 20}, {170, 300}};
  const Parts replaced = {{300, 400}, {150, 300}};
  for (const Parts& parts : {joined_last, joined_between, left, replaced}) {
    const auto bytes = chosen(all, length, parts);
    const ByteSource source(bytes, length);
    const KnownProducts known = known_of(whole, 300, parts);
    Eigen::MatrixXd shown;
    const SolverOptions anew{.solver = "gram", .components = 12};
    SolverOptions incremental = anew;
    incremental.known = &known;
    incremental.keep_products = [&](const Eigen::MatrixXd& products) { shown = products; };
    const Eigenspace a = solve_eigenspace(source, incremental);
    const Eigenspace b = solve_eigenspace(source, anew);
    EXPECT_EQ(a.mean, b.mean);
    EXPECT_EQ(a.basis, b.basis);
    EXPECT_EQ(a.eigenvalues, b.eigenvalues);
    EXPECT_EQ(a.total_scatter, b.total_scatter);
    EXPECT_EQ(shown, gram_matrix(source, {}));
  }
}

TEST(KnownProducts, HoldForFloatsAndInTiles) {
  const Eigen::MatrixXf views = test::views_of_rank(200, 250, 30, 1);
  const FloatSource source(views);
  const Eigen::MatrixXd whole = gram_matrix(source, {});
  const KnownProducts known = known_of(whole, 220, {{0, 250}});
  EXPECT_EQ(gram_matrix(source, {2, 0, &known}), whole);
  EXPECT_EQ(gram_matrix(StreamedSource(source), {2, 200 * 4 * 120, &known}), whole);
}

TEST(KnownProducts, AreTakenNotComputedAgain) {
  const auto bytes = test::smooth_views(200, 64, 1);
  const KnownProducts known{Eigen::MatrixXd::Constant(1, 1, 7.0), std::vector<Eigen::Index>(200, 0)};
  EXPECT_EQ(gram_matrix(ByteSource(bytes, 64), {1, 0, &known}), Eigen::MatrixXd::Constant(200, 200, 7.0));
}

TEST(KnownProducts, OfOtherViewsAreRefused) {
  const auto bytes = test::smooth_views(20, 64, 1);
  const ByteSource source(bytes, 64);
  const Eigen::MatrixXd products = Eigen::MatrixXd::Identity(5, 5);
  for (const KnownProducts& known : {KnownProducts{products, std::vector<Eigen::Index>(19, 0)},
                                     {products, std::vector<Eigen::Index>(20, 5)},
                                     {products, std::vector<Eigen::Index>(20, -2)},
                                     {products.leftCols(4), std::vector<Eigen::Index>(20, 0)}})
    EXPECT_THROW(gram_matrix(source, {1, 0, &known}), std::invalid_argument);
}

TEST(Gram, RefusesAMemoryLimitThatHoldsNoTwoViews) {
  const auto bytes = test::smooth_views(5, 100, 1);
  const ByteSource source(bytes, 100);
  const StreamedSource streamed(source);
  EXPECT_THROW(gram_matrix(streamed, {1, 150}), std::invalid_argument);
  EXPECT_THROW(gram_matrix(streamed, {1, 50}), std::invalid_argument);
}

TEST(Gram, NamesTheBlackView) {
  auto bytes = test::smooth_views(5, 100, 1);
  std::fill_n(bytes.begin() + 300, 100, std::uint8_t{0});
  const ByteSource source(bytes, 100);
  try {
    view_norms(gram_matrix(source, {}), true);
    FAIL() << "accepted a view without energy";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("view 3"), std::string::npos) << error.what();
  }
}

TEST(Gram, CentersLikeCenteredViews) {
  const auto bytes = test::smooth_views(40, 500, 4);
  const ByteSource source(bytes, 500);
  Eigen::MatrixXd gram = gram_matrix(source, {});
  const double total = normalize_and_center(gram, view_norms(gram, true), 2);
  Eigen::MatrixXd views(500, 40);
  for (Eigen::Index j = 0; j < 40; ++j) {
    for (Eigen::Index k = 0; k < 500; ++k) views(k, j) = bytes[static_cast<std::size_t>(j * 500 + k)];
    views.col(j).normalize();
  }
  views.colwise() -= Eigen::VectorXd(views.rowwise().mean());
  // Entries of order one, rounded a few times in double.
  EXPECT_LT((gram - views.transpose() * views).cwiseAbs().maxCoeff(), 1e-13);
  EXPECT_NEAR(total, views.squaredNorm(), 1e-12);
  EXPECT_EQ(gram, gram.transpose());
}

TEST(Gram, StopsOnRequest) {
  const auto bytes = test::smooth_views(300, 64, 5);
  const ByteSource source(bytes, 64);
  std::stop_source stop;
  const auto at_second = [&](const ProgressUpdate& update) {
    if (update.done == 2) stop.request_stop();
  };
  EXPECT_THROW(gram_matrix(source, {1, 0}, at_second, stop.get_token()), Interrupted);
}

}  // namespace
}  // namespace eigenpose
