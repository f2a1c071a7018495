#include "core/simd/targets.h"

#include <atomic>
#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>

#include "core/simd/dense_products.h"

namespace eigenpose {
namespace {

using ::testing::AnyOf;
using ::testing::HasSubstr;

TEST(SimdTargets, AreSome) {
  EXPECT_FALSE(simd_targets().empty());
}

#if defined(__x86_64__) || defined(HWY_COMPILE_ALL_ATTAINABLE)
TEST(SimdTargets, EndWithPortableCode) {
  const auto names = simd_targets();
  ASSERT_FALSE(names.empty());
  EXPECT_THAT(names.back(), AnyOf("SCALAR", "EMU128"));
}
#endif

#if defined(__aarch64__)
TEST(SimdTargets, BeginWithVectorsOnAArch64) {
  EXPECT_EQ(simd_targets().front(), "NEON");
}
#endif

#if defined(__x86_64__) && defined(__GNUC__)
TEST(SimdTargets, BeginWithTheBestThatTheProcessorHas) {
  // What Highway asks of a processor before it uses AVX2.
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2") &&
      __builtin_cpu_supports("lzcnt") && __builtin_cpu_supports("f16c") && __builtin_cpu_supports("aes") &&
      __builtin_cpu_supports("pclmul")) {
    EXPECT_EQ(simd_targets().front(), "AVX2");
  } else if (!__builtin_cpu_supports("avx2")) {
    EXPECT_NE(simd_targets().front(), "AVX2");
  }
}
#endif

/// Eight products whose sum tells a fused multiplication from a rounded one, or nothing where no target
/// fuses.
float rounded_differently() {
  float a[64];
  float b[64];
  for (int i = 0; i < 64; ++i) {
    a[i] = 1.0F + static_cast<float>(i + 1) * 0x1p-13F;
    b[i] = (i % 2 == 0 ? 1.0F : -1.0F) * (1.0F + static_cast<float>(64 - i) * 0x1p-12F);
  }
  return dot(a, b, 64);
}

TEST(SimdTargets, AreUsedWhileTheyAreTheOnlyOne) {
  const auto names = simd_targets();
  if (names.size() < 2 || (names.front() != "AVX2" && names.front() != "NEON"))
    GTEST_SKIP() << "missed: two targets, one of which fuses multiplication and addition";
  const float best = rounded_differently();
  {
    const OnlySimdTarget only(names.back());
    EXPECT_EQ(simd_targets(), std::vector<std::string>{names.back()});
    EXPECT_NE(rounded_differently(), best);
  }
  EXPECT_EQ(rounded_differently(), best);
  EXPECT_EQ(simd_targets(), names) << "afterwards all are there again";
}

TEST(SimdTargets, RefuseANameThatThereIsNot) {
  try {
    const OnlySimdTarget only("AVX9");
    FAIL();
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), HasSubstr("AVX9"));
    EXPECT_THAT(error.what(), HasSubstr(simd_targets().back()));
  }
}

TEST(SimdTargets, AreChosenOnceByManyThreadsAtATime) {
  const float expected = rounded_differently();
  std::atomic<int> wrong = 0;
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < 200; ++i) wrong += rounded_differently() == expected ? 0 : 1;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
}

}  // namespace
}  // namespace eigenpose
