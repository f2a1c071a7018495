#include "core/simd/window_scores.h"

#include <algorithm>

#include "tests/core/simd/every_target.h"

namespace eigenpose {
namespace {

/// As the header defines them.
void plain_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  const std::vector<PlacedQuery>& queries, std::int32_t* scores) {
  for (const PlacedQuery& query : queries) {
    for (std::size_t view = 0; view < groups * 8; ++view) {
      const std::int8_t* group = values + view / 8 * 256;
      std::int32_t sum = 0;
      for (std::size_t k = 0; k < 32; ++k)
        sum += static_cast<std::int32_t>(query.values[k]) * group[k / 4 * 32 + view % 8 * 4 + k % 4];
      std::int32_t& score = scores[query.index * groups * 8 + view];
      score = std::max(score, sum - biases[view] - query.penalty);
    }
  }
}

struct Place {
  std::size_t groups;
  test::Unaligned<std::int8_t> values;
  test::Unaligned<std::int32_t> biases;
  test::Unaligned<std::uint8_t> components;
  std::vector<PlacedQuery> queries;

  Place(std::size_t group_count, std::size_t query_count)
      : groups(group_count), values(groups * 256, 1), biases(groups * 8, 1), components(query_count * 32, 3) {
    for (std::size_t q = 0; q < query_count; ++q)
      queries.push_back({components.data() + q * 32, static_cast<std::int32_t>(7 * q),
                         static_cast<std::uint32_t>((q * 5 + 1) % (query_count + 1))});
  }

  void expect_plain_scores() const {
    const std::size_t rows = queries.size() + 1;
    std::vector<std::int32_t> expected(rows * groups * 8, -5000);
    plain_scores(values.data(), biases.data(), groups, queries, expected.data());
    test::on_every_target([&] {
      std::vector<std::int32_t> found(rows * groups * 8, -5000);
      raise_scores(values.data(), biases.data(), groups, queries, found.data());
      ASSERT_EQ(found, expected) << groups << " groups, " << queries.size() << " queries";
    });
  }
};

TEST(WindowScores, AreThePlainOnesForAnyNumberOfGroupsAndQueries) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> value(-128, 127);
  std::uniform_int_distribution<int> query(0, 127);
  for (const std::size_t groups : {0U, 1U, 5U}) {
    for (const std::size_t count : {0U, 1U, 2U, 3U, 15U, 16U, 17U, 33U}) {
      Place place(groups, count);
      for (std::size_t i = 0; i < place.values.size(); ++i)
        place.values[i] = static_cast<std::int8_t>(value(random));
      for (std::size_t i = 0; i < place.biases.size(); ++i) place.biases[i] = value(random) * 100;
      for (std::size_t i = 0; i < place.components.size(); ++i)
        place.components[i] = static_cast<std::uint8_t>(query(random));
      place.expect_plain_scores();
    }
  }
}

TEST(WindowScores, DoNotOverflowAtTheLargestValues) {
  for (const int value : {-128, -127, 127}) {
    for (const int bias : {-100000, 0, 100000}) {
      Place place(3, 3);
      for (std::size_t i = 0; i < place.values.size(); ++i) place.values[i] = static_cast<std::int8_t>(value);
      for (std::size_t i = 0; i < place.biases.size(); ++i) place.biases[i] = bias;
      for (std::size_t i = 0; i < place.components.size(); ++i) place.components[i] = 127;
      place.expect_plain_scores();
    }
  }
}

TEST(WindowScores, TakeEveryComponentOfEveryViewOnce) {
  for (std::size_t at = 0; at < 256; ++at) {
    Place place(1, 1);
    for (std::size_t i = 0; i < 32; ++i) place.components[i] = static_cast<std::uint8_t>(i + 1);
    place.values[at] = 1;
    place.expect_plain_scores();
  }
}

TEST(WindowScores, KeepTheBestOfQueriesThatShareARow) {
  Place place(1, 2);
  for (std::size_t i = 0; i < 256; ++i) place.values[i] = 1;
  std::fill_n(place.components.data(), 32, std::uint8_t{2});
  std::fill_n(place.components.data() + 32, 32, std::uint8_t{1});
  place.queries[0].index = place.queries[1].index = 0;
  place.queries[0].penalty = place.queries[1].penalty = 3;
  test::on_every_target([&] {
    std::vector<std::int32_t> scores(8, 0);
    raise_scores(place.values.data(), place.biases.data(), 1, place.queries, scores.data());
    EXPECT_EQ(scores, std::vector<std::int32_t>(8, 64 - 3));
  });
}

}  // namespace
}  // namespace eigenpose
