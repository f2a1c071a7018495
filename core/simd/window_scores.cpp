#include "core/simd/window_scores.h"

#include <algorithm>

#include "core/simd/compiled_targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/simd/window_scores.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "core/simd/unroll-inl.h"

HWY_BEFORE_NAMESPACE();
namespace eigenpose {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t group_views = 8;
constexpr std::size_t components = 32;
/// Components of a view that stand side by side, and stretches of them.
constexpr std::size_t together = 4;
constexpr std::size_t stretches = components / together;

#if HWY_TARGET == HWY_SCALAR

void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  std::span<const PlacedQuery> queries, std::int32_t* scores) {
  for (std::size_t g = 0; g < groups; ++g) {
    const std::int8_t* block = values + g * group_views * components;
    for (const PlacedQuery& query : queries) {
      std::int32_t* row = scores + (query.index * groups + g) * group_views;
      std::int32_t sums[group_views] = {};
      for (std::size_t k = 0; k < stretches; ++k)
        for (std::size_t v = 0; v < group_views; ++v)
          for (std::size_t i = 0; i < together; ++i)
            sums[v] += static_cast<std::int32_t>(query.values[k * together + i]) *
                       block[(k * group_views + v) * together + i];
      for (std::size_t v = 0; v < group_views; ++v)
        row[v] = std::max(row[v], sums[v] - biases[g * group_views + v] - query.penalty);
    }
  }
}

#else

// A stretch of a view is four neighbouring bytes. They are split into two pairs of words, (0, 2) and (1, 3):
// a vector of such pairs, multiplied and added in pairs, leaves one 32-bit sum for each view.
using Quads = hn::CappedTag<std::int32_t, group_views>;
using Words = hn::Repartition<std::int16_t, Quads>;
using Bytes = hn::Repartition<std::int8_t, Quads>;
constexpr std::size_t quad_lanes = hn::MaxLanes(Quads());
constexpr std::size_t parts = group_views / quad_lanes;
/// Queries that share each load of views, and those that are split at once.
constexpr std::size_t at_once = 4;
constexpr std::size_t batch = 32;

struct SplitQuery {
  std::int32_t even[stretches];  ///< components 0 and 2 of a stretch, as words
  std::int32_t odd[stretches];   ///< components 1 and 3
};

HWY_INLINE SplitQuery split(const PlacedQuery& query) {
  const hn::RebindToUnsigned<Words> d;
  const hn::Repartition<std::uint8_t, Words> d_bytes;
  SplitQuery result;
  for (std::size_t k = 0; k < stretches; k += quad_lanes) {
    const auto words = hn::BitCast(d, hn::LoadU(d_bytes, query.values + k * together));
    hn::StoreU(hn::BitCast(Quads(), hn::And(words, hn::Set(d, std::uint16_t{0xFF}))), Quads(),
               result.even + k);
    hn::StoreU(hn::BitCast(Quads(), hn::ShiftRight<8>(words)), Quads(), result.odd + k);
  }
  return result;
}

/// Two neighbouring vectors of views, or one.
template <std::size_t vectors>
struct Views {
  const std::int8_t* from[vectors];

  /// Vectors from the index `first` on of one place.
  HWY_INLINE Views(const std::int8_t* values, std::size_t first) {
    for (std::size_t v = 0; v < vectors; ++v)
      from[v] = values + (first + v) / parts * group_views * components +
                (first + v) % parts * quad_lanes * together;
  }
  HWY_INLINE void load(std::size_t k, hn::Vec<Words> (&even)[vectors], hn::Vec<Words> (&odd)[vectors]) const {
    unroll<vectors>([&](auto v) EIGENPOSE_INLINE_LAMBDA {
      const auto bytes = hn::BitCast(Words(), hn::LoadU(Bytes(), from[v] + k * group_views * together));
      even[v] = hn::ShiftRight<8>(hn::ShiftLeft<8>(bytes));
      odd[v] = hn::ShiftRight<8>(bytes);
    });
  }
};

/// The same, split once for many queries.
template <std::size_t vectors>
struct SplitViews {
  HWY_ALIGN std::int16_t words[stretches][vectors][2][hn::MaxLanes(Words())];

  HWY_INLINE explicit SplitViews(const Views<vectors>& views) {
    for (std::size_t k = 0; k < stretches; ++k) {
      hn::Vec<Words> even[vectors];
      hn::Vec<Words> odd[vectors];
      views.load(k, even, odd);
      unroll<vectors>([&](auto v) EIGENPOSE_INLINE_LAMBDA {
        hn::Store(even[v], Words(), words[k][v][0]);
        hn::Store(odd[v], Words(), words[k][v][1]);
      });
    }
  }
  HWY_INLINE void load(std::size_t k, hn::Vec<Words> (&even)[vectors], hn::Vec<Words> (&odd)[vectors]) const {
    unroll<vectors>([&](auto v) EIGENPOSE_INLINE_LAMBDA {
      even[v] = hn::Load(Words(), words[k][v][0]);
      odd[v] = hn::Load(Words(), words[k][v][1]);
    });
  }
};

/// Queries, and where their scores of the first of the views stand.
struct Share {
  const PlacedQuery* queries;
  const SplitQuery* split;
  std::int32_t* const* rows;
  std::size_t view;  ///< in each row

  [[nodiscard]] HWY_INLINE Share from(std::size_t q) const {
    return {queries + q, split + q, rows + q, view};
  }
};

/// Raises the scores of `count` queries and `vectors` vectors of views; `biases` begin at the first one.
template <std::size_t count, std::size_t vectors, template <std::size_t> class SomeViews>
HWY_INLINE void raise(const SomeViews<vectors>& views, const std::int32_t* biases, const Share& share) {
  const Words d;
  const Quads d32;
  hn::Vec<Quads> sums[count][vectors];
  hn::Vec<Quads> more[count][vectors];  // some targets split the products over two sums
  unroll<count * vectors>([&](auto i) EIGENPOSE_INLINE_LAMBDA {
    sums[i / vectors][i % vectors] = more[i / vectors][i % vectors] = hn::Zero(d32);
  });
  for (std::size_t k = 0; k < stretches; ++k) {
    hn::Vec<Words> even[vectors];
    hn::Vec<Words> odd[vectors];
    views.load(k, even, odd);
    unroll<count>([&](auto q) EIGENPOSE_INLINE_LAMBDA {
      const auto query_even = hn::BitCast(d, hn::Set(d32, share.split[q].even[k]));
      const auto query_odd = hn::BitCast(d, hn::Set(d32, share.split[q].odd[k]));
      unroll<vectors>([&](auto v) EIGENPOSE_INLINE_LAMBDA {
        sums[q][v] = hn::ReorderWidenMulAccumulate(d32, query_even, even[v], sums[q][v], more[q][v]);
        sums[q][v] = hn::ReorderWidenMulAccumulate(d32, query_odd, odd[v], sums[q][v], more[q][v]);
      });
    });
  }
  unroll<vectors>([&](auto v) EIGENPOSE_INLINE_LAMBDA {
    const auto bias = hn::LoadU(d32, biases + v * quad_lanes);
    unroll<count>([&](auto q) EIGENPOSE_INLINE_LAMBDA {
      const auto products = hn::RearrangeToOddPlusEven(sums[q][v], more[q][v]);
      const auto score = hn::Sub(products, hn::Add(bias, hn::Set(d32, share.queries[q].penalty)));
      std::int32_t* row = share.rows[q] + share.view + v * quad_lanes;
      hn::StoreU(hn::Max(hn::LoadU(d32, row), score), d32, row);
    });
  });
}

/// The same for up to `at_once` queries.
template <std::size_t vectors, template <std::size_t> class SomeViews>
HWY_INLINE void raise_some(const SomeViews<vectors>& views, const std::int32_t* biases, const Share& share,
                           std::size_t count) {
  switch (count) {
    case 1:
      raise<1>(views, biases, share);
      break;
    case 2:
      raise<2>(views, biases, share);
      break;
    case 3:
      raise<3>(views, biases, share);
      break;
    default:
      raise<4>(views, biases, share);
  }
}

/// The same for any number of queries: views are split anew for each few, or once for many.
template <std::size_t vectors>
HWY_INLINE void raise_all(const Views<vectors>& views, const std::int32_t* biases, const Share& share,
                          std::size_t count) {
  if (count <= at_once) {
    raise_some(views, biases, share, count);
    return;
  }
  const SplitViews<vectors> split_views(views);
  for (std::size_t q = 0; q < count; q += at_once)
    raise_some(split_views, biases, share.from(q), std::min(at_once, count - q));
}

void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  std::span<const PlacedQuery> queries, std::int32_t* scores) {
  SplitQuery split_queries[batch];
  std::int32_t* rows[batch];
  for (std::size_t first = 0; first < queries.size(); first += batch) {
    const std::size_t count = std::min(batch, queries.size() - first);
    for (std::size_t q = 0; q < count; ++q) {
      split_queries[q] = split(queries[first + q]);
      rows[q] = scores + queries[first + q].index * groups * group_views;
    }
    Share share{queries.data() + first, split_queries, rows, 0};
    std::size_t vector = 0;
    for (; vector + 2 <= groups * parts; vector += 2, share.view += 2 * quad_lanes)
      raise_all(Views<2>(values, vector), biases + share.view, share, count);
    if (vector < groups * parts) raise_all(Views<1>(values, vector), biases + share.view, share, count);
  }
}

#endif

}  // namespace HWY_NAMESPACE
}  // namespace eigenpose
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace eigenpose {

HWY_EXPORT(raise_scores);

void raise_scores(const std::int8_t* values, const std::int32_t* biases, std::size_t groups,
                  std::span<const PlacedQuery> queries, std::int32_t* scores) {
  HWY_DYNAMIC_DISPATCH(raise_scores)(values, biases, groups, queries, scores);
}

}  // namespace eigenpose
#endif
