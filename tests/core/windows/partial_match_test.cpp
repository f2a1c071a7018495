#include "core/windows/partial_match.h"

#include <algorithm>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

namespace eigenpose {
namespace {

const WindowScale scale = WindowScale::for_range(0.8F);

/// Windows of one view, drawn at random.
Eigen::MatrixXf random_view(std::mt19937& random) {
  std::normal_distribution<float> normal(0.0F, 0.15F);
  Eigen::MatrixXf view(WindowGrid::components, WindowGrid::positions);
  for (Eigen::Index i = 0; i < view.size(); ++i) view.data()[i] = normal(random);
  return view;
}

/// An object of a closed turn: each view has two neighbours.
PartsObject object_of(const std::vector<Eigen::MatrixXf>& views) {
  PartsObject object;
  const int count = static_cast<int>(views.size());
  for (int v = 0; v < count; ++v) {
    object.candidates.push_back({v, false});
    object.lane_candidate.push_back(static_cast<std::uint32_t>(v));
    object.neighbours.push_back({(v + 1) % count, (v + count - 1) % count});
  }
  object.store = WindowStore(views, scale);
  return object;
}

struct World {
  explicit World(std::size_t count) {
    std::mt19937 random(5);
    for (std::size_t o = 0; o < count; ++o) {
      std::vector<Eigen::MatrixXf> own(4);
      for (Eigen::MatrixXf& view : own) view = random_view(random);
      objects.push_back(object_of(own));
      views.push_back(std::move(own));
    }
    shortlist.resize(count);
    std::iota(shortlist.begin(), shortlist.end(), std::size_t{0});
  }
  std::vector<std::vector<Eigen::MatrixXf>> views;
  std::vector<PartsObject> objects;
  std::vector<std::size_t> shortlist;
};

/// The windows of a learned view, as a region has them.
QueryWindows query_of(const Eigen::MatrixXf& view) {
  QueryWindows query;
  for (int r = 0; r < QueryWindows::per_side; ++r)
    for (int c = 0; c < QueryWindows::per_side; ++c) {
      const int position = QueryWindows::stride * (r * WindowGrid::side + c);
      query.windows.push_back(quantize_query(view.col(position).data(), scale));
      query.weights.push_back(1.0F);
      query.total_weight += 1.0F;
    }
  return query;
}

TEST(PartialMatcher, PutsObjectAndViewOfTheWindowsFirst) {
  const World world(5);
  PartialMatcher matcher(world.objects, scale);
  for (std::size_t o = 0; o < 5; ++o)
    for (std::size_t v = 0; v < 4; ++v) {
      const QueryWindows query = query_of(world.views[o][v]);
      const auto votes = matcher.match(query, world.shortlist);
      ASSERT_EQ(votes.size(), 5U);
      EXPECT_EQ(votes[0].object, o);
      EXPECT_EQ(votes[0].candidate, static_cast<int>(v));
      for (std::size_t i = 1; i < votes.size(); ++i) EXPECT_LE(votes[i].score, votes[i - 1].score);
    }
}

TEST(PartialMatcher, GivesAShortlistTheVotesThatItHasAmongAllWhereThereIsNoBackground) {
  const World world(5);
  PartialMatcher matcher(world.objects, scale);
  const QueryWindows query = query_of(world.views[3][1]);
  const auto all = matcher.match(query, world.shortlist);
  const std::vector<PartialVote> kept(all.begin(), all.end());
  const std::vector<std::size_t> two{3, 0};
  for (const PartialVote& vote : matcher.match(query, two)) {
    const auto same = std::ranges::find(kept, vote.object, &PartialVote::object);
    EXPECT_EQ(vote.score, same->score);
    EXPECT_EQ(vote.candidate, same->candidate);
  }
}

TEST(PartialMatcher, LetsNoWindowVoteForWhatEightObjectsHaveInCommon) {
  World world(8);
  // The last is another; the others are copies of one.
  for (std::size_t o = 1; o < 7; ++o) world.objects[o] = world.objects[0];
  PartialMatcher matcher(world.objects, scale);
  const QueryWindows common = query_of(world.views[0][2]);
  for (const PartialVote& vote : matcher.match(common, world.shortlist)) EXPECT_EQ(vote.score, 0.0F);
  std::vector<float> plain;
  matcher.plain_votes(0, plain);
  EXPECT_GT(plain[2], 0.9F * common.total_weight) << "without background it is the view itself";
  std::vector<float> likeness;
  std::vector<float> background;
  matcher.window_likeness(0, 2, likeness, background);
  EXPECT_EQ(likeness, background);
  // What one object alone has still counts.
  const auto votes = matcher.match(query_of(world.views[7][0]), world.shortlist);
  EXPECT_EQ(votes[0].object, 7U);
  EXPECT_GT(votes[0].score, 0.5F * common.total_weight);
}

TEST(PartialMatcher, HasNoBackgroundAmongSevenObjects) {
  World world(7);
  for (std::size_t o = 1; o < 7; ++o) world.objects[o] = world.objects[0];
  PartialMatcher matcher(world.objects, scale);
  const QueryWindows common = query_of(world.views[0][2]);
  for (const PartialVote& vote : matcher.match(common, world.shortlist))
    EXPECT_GT(vote.score, 0.9F * common.total_weight);
}

TEST(PartialMatcher, SharesVotesWithTheNeighboursOfAView) {
  const World world(1);
  PartialMatcher matcher(world.objects, scale);
  const QueryWindows query = query_of(world.views[0][0]);
  (void)matcher.match(query, world.shortlist);
  std::vector<float> plain;
  matcher.plain_votes(0, plain);
  EXPECT_GT(plain[0], 0.95F * query.total_weight);
  EXPECT_LT(plain[1], 0.5F * query.total_weight) << "random views are not alike";
  // κ of the neighbours of view 0 is that of view 0; view 2 is none.
  std::vector<float> likeness;
  std::vector<float> background;
  for (const int candidate : {0, 1, 2, 3}) {
    matcher.window_likeness(0, candidate, likeness, background);
    const float mean = std::accumulate(likeness.begin(), likeness.end(), 0.0F) / query.total_weight;
    EXPECT_EQ(mean > 0.9F, candidate != 2) << candidate;
  }
}

TEST(PartialMatcher, GivesAViewTheShareOfItsNeighboursThatTheOptionSays) {
  // A region that shows one of two neighbouring views in its first rows, the other in the rest.
  const World world(1);
  const QueryWindows other = query_of(world.views[0][1]);
  QueryWindows query = query_of(world.views[0][0]);
  constexpr std::size_t first = 5UL * QueryWindows::per_side;
  std::copy(other.windows.begin() + first, other.windows.end(), query.windows.begin() + first);
  const auto rest = static_cast<float>(query.windows.size() - first);
  for (const float pooling : {0.0F, 0.5F, 1.0F}) {
    VotingOptions options;
    options.pooling = pooling;
    PartialMatcher matcher(world.objects, scale, options);
    const float expected = static_cast<float>(first) + pooling * rest;
    EXPECT_NEAR(matcher.match(query, world.shortlist)[0].score, expected, 0.02F * query.total_weight);
  }
}

/// What is left of an object when some of its views are not learned. Without neighbours.
PartsObject object_without(const World& world, std::size_t object, const std::vector<int>& left_out) {
  std::vector<Eigen::MatrixXf> kept;
  for (int v = 0; v < 4; ++v)
    if (std::ranges::find(left_out, v) == left_out.end())
      kept.push_back(world.views[object][static_cast<std::size_t>(v)]);
  PartsObject made = object_of(kept);
  for (auto& near : made.neighbours) near = {-1, -1};
  return made;
}

std::vector<std::pair<std::size_t, float>> scores_of(std::span<const PartialVote> votes) {
  std::vector<std::pair<std::size_t, float>> scores;
  for (const PartialVote& vote : votes) scores.emplace_back(vote.object, vote.score);
  return scores;
}

TEST(PartialMatcher, LeavesCandidatesOutAsIfTheyHadNotBeenLearned) {
  World world(9);
  for (std::size_t o = 0; o < 9; ++o) world.objects[o] = object_without(world, o, {});
  PartialMatcher matcher(world.objects, scale);
  const QueryWindows query = query_of(world.views[3][1]);
  const auto all = scores_of(matcher.match(query, world.shortlist));
  for (const auto& left_out : {std::vector<int>{2}, std::vector<int>{1}, std::vector<int>{0, 1, 3}}) {
    World fewer = world;
    fewer.objects[3] = object_without(world, 3, left_out);
    PartialMatcher expected(fewer.objects, scale);
    EXPECT_EQ(scores_of(matcher.match_without(3, left_out)),
              scores_of(expected.match(query, world.shortlist)));
  }
  // What was left out before is there again, in the background of the others too.
  EXPECT_EQ(scores_of(matcher.match_without(5, {})), all);
  EXPECT_THROW((void)matcher.match_without(9, {}), std::invalid_argument);
}

TEST(PartialMatcher, RefusesVotesOfAnObjectThatWasNotMatched) {
  const World world(3);
  PartialMatcher matcher(world.objects, scale);
  std::vector<float> votes;
  EXPECT_THROW(matcher.plain_votes(0, votes), std::invalid_argument) << "before any match";
  const QueryWindows query = query_of(world.views[1][0]);
  const std::vector<std::size_t> one{1};
  (void)matcher.match(query, one);
  matcher.plain_votes(1, votes);
  EXPECT_THROW(matcher.plain_votes(0, votes), std::invalid_argument);
  EXPECT_THROW(matcher.window_likeness(2, 0, votes, votes), std::invalid_argument);
  EXPECT_THROW(matcher.plain_votes(3, votes), std::invalid_argument);
}

TEST(PartialMatcher, TakesTheBestOfTheCopiesOfAView) {
  World world(1);
  // Views 2 and 3 become copies of candidates 0 and 1.
  PartsObject& object = world.objects[0];
  object.candidates.resize(2);
  object.neighbours = {{-1, -1}, {-1, -1}};
  object.lane_candidate = {0, 1, 0, 1};
  PartialMatcher matcher(world.objects, scale);
  for (std::size_t lane = 0; lane < 4; ++lane) {
    const QueryWindows query = query_of(world.views[0][lane]);
    EXPECT_EQ(matcher.match(query, world.shortlist)[0].candidate, static_cast<int>(lane % 2));
  }
}

}  // namespace
}  // namespace eigenpose
