#pragma once

/// Points to search for: near, far, on knots, at seams, between two manifolds.

#include <random>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/manifold/manifold.h"

namespace eigenpose::synthetic {

struct Query {
  const char* kind;
  Eigen::VectorXf point;
};

/// A random place of a manifold; `special` puts it on a break between segments (0 among them: the seam) or a
/// sample.
inline std::vector<double> random_place(const Manifold& f, bool special, std::mt19937& random) {
  std::vector<double> q;
  for (std::size_t a = 0; a < f.dofs(); ++a) {
    const AxisBasis& basis = f.bases()[a];
    const auto segment = std::uniform_int_distribution<std::size_t>(0, basis.segments() - 1)(random);
    const int where = std::uniform_int_distribution<int>(0, 3)(random);
    if (special && where == 0)
      q.push_back(f.axes()[a].dof.lower);
    else if (special && where == 1)
      q.push_back(f.axes()[a].samples[segment % f.axes()[a].samples.size()]);
    else if (special)
      q.push_back(basis.begin(segment));
    else
      q.push_back(basis.position({segment, std::uniform_real_distribution<double>(0.0, 1.0)(random)}));
  }
  return q;
}

inline Query random_query(std::span<const Manifold> manifolds, std::mt19937& random) {
  const auto pick = [&] {
    return std::uniform_int_distribution<std::size_t>(0, manifolds.size() - 1)(random);
  };
  std::normal_distribution<double> normal;
  const Manifold& f = manifolds[pick()];
  const auto noise = [&](double size) {
    Eigen::VectorXd v(f.dimensions());
    for (Eigen::Index k = 0; k < v.size(); ++k)
      v[k] = size * normal(random) / std::sqrt(static_cast<double>(v.size()));
    return v;
  };
  switch (std::uniform_int_distribution<int>(0, 6)(random)) {
    case 0:
      return {"exact", f.evaluate(random_place(f, false, random)).cast<float>()};
    case 1:
      return {"near", (f.evaluate(random_place(f, false, random)) + noise(0.02)).cast<float>()};
    case 2:
      return {"moved", (f.evaluate(random_place(f, false, random)) + noise(0.2)).cast<float>()};
    case 3:
      return {"knot or seam", f.evaluate(random_place(f, true, random)).cast<float>()};
    case 4:
      return {"beside a knot or seam",
              (f.evaluate(random_place(f, true, random)) + noise(0.01)).cast<float>()};
    case 5: {
      const Manifold& g = manifolds[pick()];
      return {"between two", (0.5 * (f.evaluate(random_place(f, false, random)) +
                                     g.evaluate(random_place(g, false, random))))
                                 .cast<float>()};
    }
    default:
      return {"far", noise(2.0).cast<float>()};
  }
}

}  // namespace eigenpose::synthetic
