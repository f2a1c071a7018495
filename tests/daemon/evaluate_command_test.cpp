// What `eigenpose evaluate` prints and writes.

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tests/daemon/offline_commands.h"

namespace eigenpose {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST_F(OfflineCommands, EvaluateShowsScenesOfSeveralObjects) {
  write_objects();
  const std::string line = "evaluate sets --learn-every 2 --size 32 --whole-region";
  const Ended shown = eigenpose(line + " --scenes 10 --json 2>/dev/null");
  ASSERT_EQ(shown.code, 0) << shown.output;
  const json scenes = json::parse(shown.output)["scenes"];
  EXPECT_EQ(scenes["scenes"], 10);
  EXPECT_GE(scenes["objects"].get<int>(), 20);
  EXPECT_EQ(scenes["found_rate"], 1.0);
  EXPECT_EQ(scenes["extra_boxes"], 0);
  EXPECT_THAT(eigenpose(line + " --scenes 10 --overlap 0.2").output, HasSubstr("scenes      10 with"));
  const Ended unsaid = eigenpose(line + " --overlap 0.2");
  EXPECT_EQ(unsaid.code, 1);
  EXPECT_THAT(unsaid.output, HasSubstr("--scenes 200"));
}

TEST_F(OfflineCommands, EvaluateRefusesDamageThatIsNone) {
  write_objects();
  for (const std::string wrong :
       {"--occlude nan", "--perturb shift=", "--perturb shift=inf", "--perturb rotation=1e300",
        "--perturb scale=0.95", "--perturb shift=2,shift=3", "--perturb shift=nan", "--perturb shift"}) {
    const Ended run = eigenpose("evaluate sets --learn-every 2 --size 32 --whole-region " + wrong);
    EXPECT_EQ(run.code, 1) << wrong << run.output;
    EXPECT_THAT(run.output, HasSubstr(wrong.substr(0, wrong.find(' ')))) << wrong;
  }
}

TEST_F(OfflineCommands, EvaluateWritesNoTwoResultsToOneFileThroughALink) {
  write_objects();
  std::filesystem::create_symlink("real.csv", path("link.csv"));
  const Ended run = eigenpose(
      "evaluate sets --learn-every 2 --size 32 --whole-region --csv real.csv --calibration link.csv");
  EXPECT_EQ(run.code, 1);
  EXPECT_THAT(run.output, HasSubstr("is the file of --calibration too"));
  EXPECT_FALSE(std::filesystem::exists(path("real.csv")));
}

TEST_F(OfflineCommands, EvaluateFollowsItsSeedInEverythingThatIsDrawnAtRandom) {
  write_objects();
  for (const std::string drawn : {"--scenes 10", "--perturb rotation=8,shift=3", "--occlude 0.1"}) {
    const auto report = [&](int seed) {
      const Ended run = eigenpose("evaluate sets --learn-every 2 --size 32 --whole-region --json " + drawn +
                                  " --seed " + std::to_string(seed) + " 2>/dev/null");
      EXPECT_EQ(run.code, 0) << run.output;
      json all = json::parse(run.output);
      for (const char* measured : {"times_ms", "times_us_per_view"}) all.erase(measured);
      return all;
    };
    const json first = report(1);
    EXPECT_EQ(report(1), first) << drawn;
    EXPECT_NE(report(2), first) << drawn;
  }
}

TEST_F(OfflineCommands, EvaluateBeginsWithWhatAUserGets) {
  write_objects();
  const std::string line = "evaluate sets --learn-every 2 --size 32 --whole-region";
  const Ended shown = eigenpose(line + " --leave-one-out --json 2>/dev/null");
  ASSERT_EQ(shown.code, 0) << shown.output;
  const auto result = nlohmann::ordered_json::parse(shown.output);
  std::vector<std::string> keys;
  for (const auto& [key, value] : result.items()) keys.push_back(key);
  keys.resize(5);
  EXPECT_THAT(keys, ::testing::ElementsAre("answered_right_rate", "answered_wrong_rate", "withheld_rate",
                                           "false_acceptance_rate", "recognition_rate"));
  EXPECT_NEAR(result["answered_right_rate"].get<double>() + result["answered_wrong_rate"].get<double>() +
                  result["withheld_rate"].get<double>(),
              1.0, 1e-12);
  EXPECT_EQ(result["test_views"], 18);
  EXPECT_EQ(result["unknown_views"], 18);
  EXPECT_TRUE(result["false_acceptance_rate"].is_number());
  EXPECT_FALSE(result.contains("expected_calibration_error")) << "was not asked for";
  const Ended plain = eigenpose(line + " 2>/dev/null");
  EXPECT_THAT(plain.output, AllOf(::testing::StartsWith("answered right "), HasSubstr("\nanswered wrong "),
                                  HasSubstr("\nwithheld "), HasSubstr("--leave-one-out")));
  EXPECT_TRUE(json::parse(eigenpose(line + " --json 2>/dev/null").output)["false_acceptance_rate"].is_null());
}

TEST_F(OfflineCommands, EvaluateWritesItsResultsToFiles) {
  write_objects();
  const auto content = [&](const std::string& name) {
    std::ifstream file(path(name), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  const std::string line = "evaluate sets --learn-every 2 --size 32 --whole-region --leave-one-out --json ";
  const Ended pictures =
      eigenpose(line + "--roc roc.svg --calibration c.svg --csv regions.csv --confusion m.svg 2>/dev/null");
  ASSERT_EQ(pictures.code, 0) << pictures.output;
  EXPECT_TRUE(json::parse(pictures.output)["expected_calibration_error"].is_number());
  EXPECT_THAT(content("roc.svg"), HasSubstr("in use: evidence"));
  EXPECT_THAT(content("c.svg"), HasSubstr("expected calibration error"));
  EXPECT_THAT(content("m.svg"), HasSubstr("duck called duck"));
  const std::string regions = content("regions.csv");
  EXPECT_EQ(std::count(regions.begin(), regions.end(), '\n'), 1 + 2 * 18);
  EXPECT_THAT(regions, AllOf(HasSubstr("\r\nduck,1,1,20,"), HasSubstr("\r\nmug,0,1,20,")));
  const Ended tables = eigenpose(line + "--roc roc.csv --calibration c.csv 2>/dev/null");
  ASSERT_EQ(tables.code, 0) << tables.output;
  EXPECT_THAT(content("roc.csv"), ::testing::StartsWith("threshold,false_rejection,false_acceptance,"));
  EXPECT_THAT(content("c.csv"), ::testing::StartsWith("from,to,regions,"));
  EXPECT_THAT(eigenpose(line.substr(0, line.size() - 7) + "--calibration c.csv 2>/dev/null").output,
              HasSubstr("% expected calibration error over "));
}

TEST_F(OfflineCommands, EvaluateRefusesFilesThatCannotBeWrittenBeforeItLearns) {
  write_objects();
  const auto refused = [&](const std::string& options) {
    const Ended run = eigenpose("evaluate sets --size 32 --whole-region " + options);
    EXPECT_EQ(run.code, 1) << options;
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
    return run.output;
  };
  EXPECT_THAT(refused("--roc roc.svg"), AllOf(HasSubstr("--roc: "), HasSubstr("add --leave-one-out")));
  EXPECT_THAT(refused("--leave-one-out --roc roc.png"),
              HasSubstr("--roc: \"roc.png\" does not end in .csv or .svg"));
  EXPECT_THAT(refused("--calibration c"), HasSubstr("--calibration: \"c\" does not end in .csv or .svg"));
  EXPECT_THAT(refused("--csv c.svg"), HasSubstr("--csv: \"c.svg\" does not end in .csv"));
  EXPECT_THAT(refused("--confusion c.csv"), HasSubstr("--confusion: \"c.csv\" does not end in .svg"));
  EXPECT_THAT(refused("--calibration a.csv --csv ./a.csv"), HasSubstr("is the file of --calibration too"));
  EXPECT_THAT(refused("--csv nowhere/a.csv"), HasSubstr("nowhere"));
  EXPECT_FALSE(std::filesystem::exists(path("a.csv")));
}

TEST_F(OfflineCommands, TheTwoRatesAreSetInLearnAndEvaluate) {
  write_objects();
  for (const std::string command : {"learn sets --to a.model ", "evaluate sets "}) {
    EXPECT_EQ(eigenpose(command + "--false-rejection 0.6").code, 2) << command;
    EXPECT_EQ(eigenpose(command + "--false-rejection -0.1").code, 2) << command;
    EXPECT_EQ(eigenpose(command + "--false-acceptance 1.1").code, 2) << command;
    EXPECT_THAT(eigenpose(command + "--rejection-rate 0.1").output, HasSubstr("\"--rejection-rate\""))
        << command;
  }
  const auto learned = [&](const std::string& rates) {
    EXPECT_EQ(eigenpose("learn sets --to a.model --size 32 " + rates).code, 0) << rates;
    return json::parse(eigenpose("inspect a.model --json").output)["decision"];
  };
  const auto shown = [&](const std::string& rates) {
    EXPECT_EQ(eigenpose("evaluate sets --size 32 --csv regions.csv " + rates).code, 0) << rates;
    std::ifstream file(path("regions.csv"), std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  const json model = learned("");
  const std::string regions = shown("");
  EXPECT_EQ(learned("--false-rejection 0.001 --false-acceptance 0.005"), model) << "what it is by default";
  EXPECT_EQ(shown("--false-rejection 0.001 --false-acceptance 0.005"), regions);
  EXPECT_NE(learned("--false-rejection 0.5"), model);
  EXPECT_NE(shown("--false-rejection 0.5 --false-acceptance 1"), regions);
  EXPECT_NE(shown("--occlude 0.2 --false-acceptance 1"), shown("--occlude 0.2"));
}

}  // namespace
}  // namespace eigenpose
