#pragma once

/// The oracle of the solvers: a full eigen-solve in double, by no method that they use.

#include "core/subspace/appearance_source.h"
#include "core/subspace/eigenspace.h"
#include "core/subspace/solver.h"

namespace eigenpose::test {

/// The eigenspace of all views of `source` with `components` dimensions, or fewer where the views span fewer.
/// Holds all views in double, O(min(M, N)³): for small sets.
Eigenspace dense_eigenspace(const AppearanceSource& source, std::size_t components);

}  // namespace eigenpose::test
