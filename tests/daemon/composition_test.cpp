#include "daemon/composition.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/error.h"

namespace eigenpose {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

const std::string axis = "[sim]\n[[axis]]\nname = \"table\"\ndriver = \"modbus\"\nendpoint = \"simulated\"\n";
const std::string plan = axis + "[[plan]]\nname = \"p\"\n[[plan.axis]]\n";

std::string refusal(const std::string& text) {
  try {
    (void)service_options(parse_config(text, "rig.toml"));
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Composition, AConfiguredPlanMustSuitTheAxesAndIsNamedWithItsLine) {
  EXPECT_THAT(refusal(plan + "axis = \"slide\"\nat = [0]\n"),
              AllOf(StartsWith("rig.toml:6: "), HasSubstr("there is no axis \"slide\"; allowed: table")));
  EXPECT_THAT(refusal(plan + "axis = \"table\"\nat = [400]\n"),
              AllOf(StartsWith("rig.toml:6: "), HasSubstr("allowed: 0 to 360")));
  EXPECT_THAT(refusal(plan + "axis = \"table\"\nfrom = 90\nto = 90\ncount = 2\n"), HasSubstr("empty"));
  const ServiceOptions options =
      service_options(parse_config(plan + "axis = \"table\"\nfrom = 0\nto = 360\ncount = 36\n", "rig.toml"));
  ASSERT_EQ(options.plans.size(), 1U);
  EXPECT_EQ(options.plans[0].name, "p");
  EXPECT_EQ(options.plans[0].size(), 36U);
  EXPECT_EQ(options.plans[0].at(35)[0], 350.0);
}

TEST(Composition, AnImageTypeThatIsNotKnownIsRefusedWithItsKey) {
  EXPECT_THAT(refusal("[learn]\ntype = \"smell\"\n"),
              AllOf(StartsWith("rig.toml: [learn] type: "), HasSubstr("smell")));
}

TEST(Composition, EveryKeyOfLearningAndWatchingReachesTheService) {
  const ServiceOptions options = service_options(parse_config(
      "[daemon]\nstate_dir = \"/s\"\n[learn]\ncomponents = 7\nenergy = 0.5\nsize = 32\ncolor = false\n"
      "false_rejection = 0.02\nfalse_acceptance = 0.03\n[watch]\nenabled = false\nsettle_ms = 123\nthreshold "
      "= 4.5\n",
      "rig.toml"));
  EXPECT_EQ(options.image_sets, "/s/sets");
  EXPECT_EQ(options.model_file, "/s/model.h5");
  EXPECT_EQ(options.learning.solver.components, 7U);
  EXPECT_EQ(options.learning.solver.energy, 0.5);
  EXPECT_EQ(options.learning.normalization.size, 32);
  EXPECT_FALSE(options.learning.normalization.color);
  EXPECT_EQ(options.learning.rates.false_rejection, 0.02);
  EXPECT_EQ(options.learning.rates.false_acceptance, 0.03);
  EXPECT_EQ(options.learning.image_sets, "/s/sets");
  EXPECT_FALSE(options.watch.enabled);
  EXPECT_EQ(options.watch.scene.settle, std::chrono::milliseconds(123));
  EXPECT_EQ(options.watch.scene.threshold, 4.5);
}

TEST(Composition, EveryLimitOfTheApiReachesTheServer) {
  const ServerOptions options = server_options(
      parse_config("[api]\nmax_connections = 3\nmax_body_kib = 2\nrequest_timeout_ms = 400\n", "rig.toml")
          .api);
  EXPECT_EQ(options.limits.max_body, 2048U);
  EXPECT_EQ(options.request_timeout, std::chrono::milliseconds(400));
}

}  // namespace
}  // namespace eigenpose
