#include "daemon/cli/left_out_report.h"

#include <cstddef>
#include <cstdio>

namespace eigenpose::cli {
namespace {

/// So many single views are named; whole objects always are.
constexpr std::size_t most_named = 20;

}  // namespace

void print_warnings(std::span<const std::string> warnings) {
  for (const std::string& warning : warnings) std::fprintf(stderr, "warning: %s\n", warning.c_str());
}

void print_left_out(std::span<const LeftOut> left_out) {
  std::size_t views = 0;
  for (const LeftOut& what : left_out) {
    if (!what.whole_object && ++views > most_named) continue;
    std::fprintf(stderr, "warning: left out %s\n", what.text().c_str());
  }
  if (views > most_named) std::fprintf(stderr, "warning: left out %zu more views\n", views - most_named);
}

}  // namespace eigenpose::cli
