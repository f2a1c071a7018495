// Learns the views of a file in a process that may have only so much memory beside what it starts with.
//
//     streaming_probe FILE LENGTH SOLVER COMPONENTS MEMORY_LIMIT RESULT
//
// RESULT gets the basis as floats. Exit code 0: learned; 2: an error, on stderr; 3: the limit could not be
// set; 4: the limit does not bite.

#include <cstdio>
#include <exception>
#include <fstream>
#include <new>
#include <string>
#include <vector>

#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include "core/subspace/solver.h"
#include "tests/support/byte_file_source.h"

namespace {

/// What the process may have beside the limit given to the solver: the heap's bookkeeping, the packed tiles
/// of one thread (0.6 MB), buffers of streams, the error texts.
constexpr std::size_t kSlack = std::size_t{4} << 20;

std::size_t address_space() {
  std::size_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
}

/// More than the limit and the slack cannot be had.
bool limit_bites(std::size_t bytes) {
  try {
    const std::vector<char> too_much(bytes + 2 * kSlack, 1);
    return too_much[bytes] != 1;
  } catch (const std::bad_alloc&) {
    return true;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 7) return 2;
  const std::size_t memory = std::stoul(argv[5]);
  // One arena, and freed memory goes back at once: address space is what is limited.
  ::mallopt(M_ARENA_MAX, 1);
  ::mallopt(M_MMAP_THRESHOLD, 128 * 1024);
  const rlim_t allowed = address_space() + memory + kSlack;
  const rlimit limit{allowed, allowed};
  if (::setrlimit(RLIMIT_AS, &limit) != 0) return 3;
  if (!limit_bites(memory)) return 4;
  try {
    const eigenpose::ByteFileSource source(argv[1], std::stoul(argv[2]));
    eigenpose::SolverOptions options;
    options.solver = argv[3];
    options.components = std::stoul(argv[4]);
    options.threads = 1;  // a second thread's stack alone would be 8 MB of address space
    options.memory_limit = memory;
    const eigenpose::Eigenspace space = eigenpose::solve_eigenspace(source, options);
    std::ofstream out(argv[6], std::ios::binary);
    out.write(reinterpret_cast<const char*>(space.basis.data()),
              static_cast<std::streamsize>(sizeof(float) * static_cast<std::size_t>(space.basis.size())));
    return out.flush() ? 0 : 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "streaming_probe: %s\n", error.what());
    return 2;
  }
}
