#include "core/simd/projection.h"

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

TEST(Projection, IsTheProductWithTheTransposedBasis) {
  std::srand(1);
  for (const Eigen::Index rows : {1, 3, 7, 8, 9, 64, 513, 1030}) {
    for (const Eigen::Index cols : {0, 1, 3, 4, 5, 11}) {
      const Eigen::MatrixXf basis = Eigen::MatrixXf::Random(rows, cols);
      const Eigen::VectorXf x = Eigen::VectorXf::Random(rows);
      const Eigen::VectorXd expected = basis.cast<double>().transpose() * x.cast<double>();
      const Eigen::VectorXd magnitude =
          basis.cast<double>().cwiseAbs().transpose() * x.cast<double>().cwiseAbs();
      test::on_every_target([&] {
        Eigen::VectorXf out = Eigen::VectorXf::Constant(cols + 2, 9.0F);
        project_onto(basis, x, out.segment(1, cols));
        for (Eigen::Index k = 0; k < cols; ++k)
          ASSERT_NEAR(out[k + 1], expected[k], static_cast<double>(rows) * 0x1p-24 * magnitude[k])
              << rows << " x " << cols;
        EXPECT_EQ(out[0], 9.0F);
        EXPECT_EQ(out[cols + 1], 9.0F);
      });
    }
  }
}

TEST(Projection, OfSeveralAppearancesIsThatOfEachToTheLastBit) {
  std::srand(2);
  for (const Eigen::Index rows : {5, 64, 1030}) {
    const Eigen::MatrixXf basis = Eigen::MatrixXf::Random(rows, 7);
    const Eigen::MatrixXf x = Eigen::MatrixXf::Random(rows, most_projected);
    test::on_every_target([&] {
      for (Eigen::Index count = 0; count <= most_projected; ++count) {
        Eigen::MatrixXf out = Eigen::MatrixXf::Constant(7, most_projected, 9.0F);
        project_onto(basis, x, count, out);
        for (Eigen::Index n = 0; n < most_projected; ++n) {
          Eigen::VectorXf alone = Eigen::VectorXf::Constant(7, 9.0F);
          if (n < count) project_onto(basis, Eigen::VectorXf(x.col(n)), alone);
          ASSERT_EQ(Eigen::VectorXf(out.col(n)), alone) << rows << ' ' << count << ' ' << n;
        }
      }
    });
  }
}

}  // namespace
}  // namespace eigenpose
