// The commands that need no service, run as a person runs them.

#include "tests/daemon/offline_commands.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/dataset/image_set.h"
#include "core/image/picture_file.h"
#include "tests/support/synthetic_objects.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define EIGENPOSE_SANITIZED 1
#else
#define EIGENPOSE_SANITIZED 0
#endif

namespace eigenpose {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST_F(OfflineCommands, KeepTheImageTypeInTheModelAndUseItEverywhere) {
  write_objects();
  for (const std::string type :
       {"grey", "gradient", "laplacian", "fourier", "color+gradient", "grey:0.7+gradient:0.3"}) {
    const Ended learned = eigenpose("learn sets --to a.model --size 32 --whole-region --type " + type);
    ASSERT_EQ(learned.code, 0) << learned.output;
    const json model = json::parse(eigenpose("inspect a.model --json").output);
    EXPECT_EQ(model["type"], type);
    const json seen = json::parse(eigenpose("recognize mug.png --model a.model --json").output);
    ASSERT_EQ(seen[0]["outcomes"].size(), 1U) << type;
    EXPECT_EQ(seen[0]["outcomes"][0]["object"], "mug") << type;
  }
}

TEST_F(OfflineCommands, SayHowFarOffTheEnergyOfASimplifyingSolverMayBe) {
  write_objects();
  for (const std::string solver : {"gram", "joined", "sta"}) {
    const Ended learned = eigenpose("learn sets --to a.model --size 32 --whole-region --solver " + solver);
    ASSERT_EQ(learned.code, 0) << learned.output;
    const json made = json::parse(eigenpose("inspect a.model --json").output)["provenance"];
    EXPECT_EQ(made["solver"], solver);
    const std::string text = eigenpose("inspect a.model").output;
    EXPECT_THAT(text, HasSubstr("dimensions by " + solver + " keep "));
    // Eighteen views that all differ leave the joined solver nothing to leave out.
    EXPECT_EQ(made["energy_bound"] > 0.01, solver == "sta") << made;
    EXPECT_EQ(text.find("of the scatter (within ") != std::string::npos, solver == "sta") << text;
    const json seen = json::parse(eigenpose("recognize mug.png --model a.model --json").output);
    ASSERT_EQ(seen[0]["outcomes"].size(), 1U);
    EXPECT_EQ(seen[0]["outcomes"][0]["object"], "mug") << solver;
  }
}

TEST_F(OfflineCommands, RefuseAnImageTypeThatIsNotThere) {
  write_objects();
  const Ended unknown = eigenpose("learn sets --to a.model --type edges");
  EXPECT_EQ(unknown.code, 1);
  EXPECT_THAT(unknown.output, AllOf(HasSubstr("\"edges\""), HasSubstr("known are grey, color")));
  const Ended range = eigenpose("learn sets --to a.model --type range");
  EXPECT_EQ(range.code, 1);
  EXPECT_THAT(range.output, HasSubstr("hold no range"));
}

TEST_F(OfflineCommands, LearnAndRecognizeRange) {
  ImageSetWriter writer(path("sets"), "ramp", turntable_workspace(), json::object(),
                        {.cropped = true, .sync_every_view = false});
  ImageSetWriter other(path("sets"), "step", turntable_workspace(), json::object(),
                       {.cropped = true, .sync_every_view = false});
  const auto view = [](bool step, int turn) {
    cv::Mat depth(40, 40, CV_16UC1, cv::Scalar(0));
    for (int y = 8; y < 32; ++y)
      for (int x = 4; x < 36; ++x)
        depth.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(
            step ? (x < 10 + turn ? 30000 : 500 * y) : 20000 + 300 * ((x + turn) % 32) + 100 * y);
    return depth;
  };
  for (int turn = 0; turn < 20; ++turn) {
    writer.add(view(false, turn), {18.0 * turn});
    other.add(view(true, turn), {18.0 * turn});
  }
  writer.finish();
  other.finish();
  const auto png = encode_png(view(true, 7));
  std::ofstream(path("step.png"), std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  const Ended learned = eigenpose("learn sets --to a.model --size 32 --type range");
  ASSERT_EQ(learned.code, 0) << learned.output;
  const json seen = json::parse(eigenpose("recognize step.png --model a.model --json").output);
  EXPECT_EQ(seen[0]["outcomes"][0]["object"], "step");
  EXPECT_NEAR(seen[0]["outcomes"][0]["q"][0].get<double>(), 126.0, 4.0) << "a fifth of a step";
}

TEST_F(OfflineCommands, LetObjectsJoinAndLeaveAModelWithoutTheImagesOfTheOthers) {
  write_objects();
  ASSERT_EQ(eigenpose("learn sets --to a.model --size 32 --whole-region --keep-views").code, 0);
  std::filesystem::remove_all(path("sets"));
  testing::write_turn(path("new"), "cup", 3, 18);
  const auto objects = [&](const std::string& model) {
    std::string names;
    const json all = json::parse(eigenpose("inspect " + model + " --json").output);
    for (const json& object : all["objects"]) names += object["name"].get<std::string>() + " ";
    return names;
  };
  const Ended joined = eigenpose("learn new --update a.model --to b.model");
  ASSERT_EQ(joined.code, 0) << joined.output;
  EXPECT_EQ(objects("b.model"), "cup duck mug ");
  EXPECT_EQ(objects("a.model"), "duck mug ");
  const Ended left = eigenpose("learn --update b.model --remove duck,cup");
  ASSERT_EQ(left.code, 0) << left.output;
  EXPECT_EQ(objects("b.model"), "mug ");
  EXPECT_EQ(
      json::parse(eigenpose("recognize mug.png --model b.model --json").output)[0]["outcomes"][0]["object"],
      "mug");
  const Ended again = eigenpose("learn new --update b.model --objects cup");
  ASSERT_EQ(again.code, 0) << again.output;
  EXPECT_EQ(objects("b.model"), "cup mug ");

  const auto refused = [&](const std::string& arguments) {
    const Ended run = eigenpose(arguments);
    EXPECT_NE(run.code, 0) << arguments;
    return run.output;
  };
  EXPECT_THAT(refused("learn --update b.model --remove duck"),
              AllOf(HasSubstr("duck"), HasSubstr("cup, mug")));
  EXPECT_THAT(refused("learn new --update b.model"), HasSubstr("\"cup\" is learned already"));
  EXPECT_THAT(refused("learn --update b.model"), HasSubstr("--remove"));
  EXPECT_THAT(refused("learn --update b.model --remove cup,mug"), HasSubstr("no object would be left"));
  EXPECT_THAT(refused("learn new --update b.model --size 64"), HasSubstr("excludes --size"));
  ASSERT_EQ(eigenpose("learn new --to b.model --size 32 --whole-region").code, 0);
  EXPECT_THAT(refused("learn --update b.model --remove cup"),
              HasSubstr("b.model.views: does not belong to b.model"));
  std::filesystem::remove(path("b.model.views"));
  EXPECT_THAT(refused("learn --update b.model --remove cup"),
              AllOf(HasSubstr("no kept views"), HasSubstr("--keep-views")));
}

TEST_F(OfflineCommands, ImportATableOfPosesAndLearnIt) {
  std::filesystem::create_directories(path("shots"));
  std::string table = "object,file,table_deg\r\n";
  for (int kind = 1; kind <= 2; ++kind)
    for (int i = 0; i < 12; ++i) {
      const double angle = 30.0 * i + (i % 3) * 4.5;
      const std::string name = "shots/k" + std::to_string(kind) + ", " + std::to_string(i) + ".png";
      const auto png = encode_png(testing::scene_with(kind, angle));
      std::ofstream(path(name), std::ios::binary)
          .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
      table += (kind == 1 ? "duck,\"" : "mug,\"") + name + "\"," + std::to_string(angle) + "\r\n";
    }
  std::ofstream(path("poses.csv"), std::ios::binary) << table;
  const Ended imported = eigenpose("import table poses.csv --to sets");
  ASSERT_EQ(imported.code, 0) << imported.output;
  EXPECT_THAT(imported.output, HasSubstr("imported 2 objects, 24 views into sets"));
  ASSERT_EQ(eigenpose("learn sets --to a.model --size 32").code, 0);
  const auto png = encode_png(testing::scene_with(2, 130.0));
  std::ofstream(path("mug.png"), std::ios::binary)
      .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
  const json seen = json::parse(eigenpose("recognize mug.png --model a.model --json").output);
  ASSERT_EQ(seen[0]["outcomes"].size(), 1U);
  EXPECT_EQ(seen[0]["outcomes"][0]["object"], "mug");
  const Ended again = eigenpose("import table poses.csv --to sets");
  EXPECT_EQ(again.code, 0) << again.output;
  EXPECT_THAT(again.output, HasSubstr("2 of them stood there"));
}

TEST_F(OfflineCommands, SayWhichLineOfATableIsWrong) {
  write_objects();
  std::ofstream(path("poses.csv"), std::ios::binary)
      << "file,object,table_deg\nmug.png,mug,0\nmug.png,duck,a\n";
  const Ended wrong = eigenpose("import table poses.csv --to other");
  EXPECT_EQ(wrong.code, 1);
  EXPECT_THAT(wrong.output,
              AllOf(HasSubstr("poses.csv"), HasSubstr("line 3"), HasSubstr("table_deg is \"a\"")));
  std::ofstream(path("poses.csv"), std::ios::binary)
      << "file,object,table_deg\nmug.png,mug,0\nmug.png,duck,9\n";
  const Ended unknown = eigenpose("import table poses.csv --to other --ignore colour");
  EXPECT_EQ(unknown.code, 1);
  EXPECT_THAT(unknown.output, HasSubstr("\"colour\" is to be ignored"));
  EXPECT_FALSE(std::filesystem::exists(path("other")));
}

TEST_F(OfflineCommands, LearnLeavesOutWhatCannotBeUsedUnlessStrict) {
  write_objects();
  std::filesystem::resize_file(path("sets/mug/000003.png"), 200);
  std::filesystem::resize_file(path("sets/duck/000000.png"), 200);
  std::filesystem::create_directories(path("sets/broken"));
  std::ofstream(path("sets/broken/set.json")) << "{";
  ImageSetWriter(path("sets"), "begun", turntable_workspace(), json::object())
      .add(testing::scene_with(1, 0.0), {0.0});
  const Ended learned = eigenpose("learn sets --to a.model --size 32 --whole-region");
  ASSERT_EQ(learned.code, 0) << learned.output;
  for (const char* named : {"left out mug: sets/mug/000003.png: ", "left out duck: sets/duck/000000.png: ",
                            "left out broken: ", "left out begun: ", "learned 2 objects from 34 views"})
    EXPECT_THAT(learned.output, HasSubstr(named));
  std::filesystem::remove_all(path("sets/broken"));
  EXPECT_THAT(eigenpose("learn sets --to b.model --size 32 --whole-region --strict").output,
              AllOf(HasSubstr("begun"), HasSubstr("not complete")));
  std::filesystem::remove_all(path("sets/begun"));
  const Ended strict = eigenpose("learn sets --to b.model --size 32 --whole-region --strict --objects mug");
  EXPECT_EQ(strict.code, 1);
  EXPECT_THAT(strict.output, HasSubstr("000003.png"));
  EXPECT_FALSE(std::filesystem::exists(path("b.model")));
}

TEST_F(OfflineCommands, EverySearchSaysTheSame) {
  write_objects();
  ASSERT_EQ(eigenpose("learn sets --to a.model --size 32 --whole-region").code, 0);
  const json tree =
      json::parse(eigenpose("recognize mug.png --model a.model --json").output)[0]["outcomes"][0];
  EXPECT_EQ(tree["object"], "mug");
  for (const std::string search : {"slab", "flann", "tree --rejector", "rbf"}) {
    const Ended run = eigenpose("recognize mug.png --model a.model --json --search " + search);
    ASSERT_EQ(run.code, 0) << run.output;
    const json said = json::parse(run.output)[0]["outcomes"][0];
    EXPECT_EQ(said["object"], "mug") << search;
    // Networks are approximate: within half of the 20 degrees between learned views.
    const double tolerance = search == "rbf" ? 10.0 : 1e-3;
    EXPECT_NEAR(said["q"][0].get<double>(), tree["q"][0].get<double>(), tolerance) << search;
  }
  EXPECT_EQ(eigenpose("recognize mug.png --model a.model --search guess").code, 2);
}

TEST_F(OfflineCommands, ResampleToTablesAndHdf5) {
  write_objects();
  ASSERT_EQ(eigenpose("learn sets --to a.model --size 32 --whole-region --components 5").code, 0);
  ASSERT_EQ(eigenpose("resample a.model --per-turn 90 --to a.csv").output, "a-duck.csv\na-mug.csv\n");
  std::ifstream table(path("a-mug.csv"));
  std::string header;
  std::getline(table, header);
  EXPECT_EQ(header, "table [deg],e1,e2,e3,e4,e5\r");
  std::size_t rows = 0;
  for (std::string row; std::getline(table, row);) ++rows;
  EXPECT_EQ(rows, 90U);
  ASSERT_EQ(eigenpose("resample a.model --objects mug --to a.h5").code, 0);
  EXPECT_GT(std::filesystem::file_size(path("a.h5")), 360U * 6 * sizeof(double));
  EXPECT_THAT(eigenpose("resample a.model --to a.txt").output, HasSubstr(".csv"));
  EXPECT_THAT(eigenpose("resample a.model --objects cat --to a.csv").output, HasSubstr("no \"cat\""));
}

TEST_F(OfflineCommands, InspectShowsTheGeometryOfManifolds) {
  write_objects();
  ASSERT_EQ(eigenpose("learn sets --to a.model --size 32 --whole-region").code, 0);
  EXPECT_THAT(eigenpose("inspect a.model --geometry").output,
              AllOf(HasSubstr("sharpest bend"), HasSubstr("mug")));
  const json model = json::parse(eigenpose("inspect a.model --geometry --json").output);
  const json& places = model["objects"][1]["geometry"][0]["places"];
  ASSERT_EQ(places.size(), 18U);
  double across = 0.0;
  for (std::size_t k = 0; k < places[3]["tangent"].size(); ++k)
    across += places[3]["tangent"][k].get<double>() * places[3]["normal"][k].get<double>();
  EXPECT_NEAR(across, 0.0, 1e-9) << "the normal stands on the tangent";
}

TEST_F(OfflineCommands, LearnKeepsNoWindowsWhereWholeRegionsAreCompared) {
  write_objects();
  ASSERT_EQ(eigenpose("learn sets --to parts.model --size 32").code, 0);
  ASSERT_EQ(eigenpose("learn sets --to whole.model --size 32 --whole-region").code, 0);
  const auto content = [&](const std::string& name) {
    std::ostringstream bytes;
    bytes << std::ifstream(path(name), std::ios::binary).rdbuf();
    return bytes.str();
  };
  // Names stand in an HDF5 file as they are: of the group of what only windows need.
  EXPECT_NE(content("parts.model").find("voting"), std::string::npos);
  EXPECT_EQ(content("whole.model").find("voting"), std::string::npos);
}

TEST_F(OfflineCommands, ImportLeavesOutAPictureThatCannotBeUsedUnlessStrict) {
  std::filesystem::create_directories(path("shots"));
  std::string table = "file,object,table_deg\n";
  for (int i = 0; i < 4; ++i) {
    const auto png = encode_png(testing::scene_with(1, 90.0 * i));
    const std::string name = "shots/duck__" + std::to_string(i) + ".png";
    std::ofstream(path(name), std::ios::binary)
        .write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
    table += name + ",duck," + std::to_string(90 * i) + "\n";
  }
  std::ofstream(path("poses.csv")) << table;
  std::filesystem::resize_file(path("shots/duck__2.png"), 100);
  for (const std::string source : {"table poses.csv", "coil shots --angle index:90"}) {
    const Ended refused = eigenpose("import " + source + " --to strict --strict");
    EXPECT_EQ(refused.code, 1) << source;
    EXPECT_THAT(refused.output, HasSubstr("duck__2.png")) << source;
    EXPECT_FALSE(std::filesystem::exists(path("strict/duck/set.json")) &&
                 ImageSet::open(path("strict/duck")).complete())
        << source;
    std::filesystem::remove_all(path("strict"));
    const Ended imported = eigenpose("import " + source + " --to sets");
    EXPECT_EQ(imported.code, 0) << imported.output;
    EXPECT_THAT(imported.output, AllOf(HasSubstr("duck__2.png"), HasSubstr("1 objects, 3 views"))) << source;
    std::filesystem::remove_all(path("sets"));
  }
}

TEST_F(OfflineCommands, SuggestTheCommandOrOptionThatWasMeant) {
  const auto refused = [&](const std::string& arguments) {
    const Ended run = eigenpose(arguments);
    EXPECT_EQ(run.code, 2) << arguments;
    EXPECT_THAT(run.output, ::testing::StartsWith("eigenpose: usage error: ")) << arguments;
    EXPECT_EQ(std::count(run.output.begin(), run.output.end(), '\n'), 1) << run.output;
    return run.output;
  };
  EXPECT_THAT(refused("recogniz mug.png --model a.model"),
              HasSubstr("\"recogniz\", did you mean \"recognize\"?"));
  EXPECT_THAT(refused("import coli x"), HasSubstr("\"coli\", did you mean \"coil\"?"));
  EXPECT_THAT(
      refused("recognize mug.png --model a.model --jsn"),
      AllOf(HasSubstr("\"--jsn\", did you mean \"--json\"?"), HasSubstr("'eigenpose recognize --help'")));
  EXPECT_THAT(refused("status --sokcet=x"), HasSubstr("\"--sokcet\", did you mean \"--socket\"?"));
  EXPECT_THAT(refused("status more"), HasSubstr("\"more\" is one argument too many"));
  EXPECT_THAT(refused("dance"), ::testing::Not(HasSubstr("did you mean")));
  EXPECT_THAT(refused("dance\\\x1b[2J"), ::testing::Not(HasSubstr("\x1b")));
  EXPECT_THAT(refused(""), HasSubstr("'eigenpose --help'"));
}

TEST_F(OfflineCommands, HelpOfACommandEndsWithItsOwnExamples) {
  for (const std::string command :
       {"acquire",   "results", "status",   "objects",   "lab",       "import",           "learn",
        "recognize", "inspect", "resample", "evaluate",  "doctor",    "devices",          "jog",
        "home",      "lamp",    "lab list", "lab place", "lab fault", "lab fault camera", "import coil"}) {
    const Ended help = eigenpose(command + " --help");
    EXPECT_EQ(help.code, 0) << command;
    EXPECT_THAT(help.output, ::testing::Not(HasSubstr("Start here:"))) << command;
    if (command.starts_with("lab ")) {
      EXPECT_THAT(help.output, ::testing::Not(HasSubstr("eigenpose lab truth  "))) << command;
    }
  }
  EXPECT_THAT(eigenpose("--help").output, HasSubstr("Start here:"));
  EXPECT_THAT(eigenpose("lab --help").output, HasSubstr("eigenpose lab truth "));
}

TEST_F(OfflineCommands, RefuseOptionsThatWouldHaveNoEffect) {
  write_objects();
  for (const std::string arguments :
       {"results --count 3", "learn --to a.model", "learn --size 32", "learn --grey", "learn --keep-views",
        "learn --memory-limit 100", "learn --threads 2", "learn sets", "learn sets --to a.model --json",
        "learn --remove duck"}) {
    const Ended run = eigenpose(arguments + " 2>&1");
    EXPECT_EQ(run.code, 2) << arguments << ": " << run.output;
    EXPECT_THAT(run.output, HasSubstr("usage error")) << arguments;
  }
  EXPECT_FALSE(std::filesystem::exists(path("a.model")));
  // What the service takes is sent to it, and it is not there.
  const Ended sent = eigenpose("learn --components 20 --objects duck,mug --socket nowhere");
  EXPECT_EQ(sent.code, 1);
  EXPECT_THAT(sent.output, HasSubstr("nowhere"));
}

TEST_F(OfflineCommands, PrintARecognisedObjectWithItsPoseInDegrees) {
  write_objects();
  ASSERT_EQ(eigenpose("learn sets --to a.model --size 32 --whole-region").code, 0);
  EXPECT_THAT(eigenpose("recognize mug.png --model a.model").output,
              ::testing::ContainsRegex("mug at 1(19|20)\\.[0-9]° ± [0-9.]+ \\(evidence [0-9.]+ of -?[0-9.]+, "
                                       "confidence [01]\\.[0-9][0-9]\\)"));
}

// Views of 256 x 256 pixels, four times the memory that learning is given, in a process that may have no more
// data than that and what the program itself takes. Without the limit the same process cannot learn them.
TEST_F(OfflineCommands, LearnASetOfFourTimesTheMemoryLimitUnderThatLimit) {
  if (EIGENPOSE_SANITIZED) GTEST_SKIP() << "a sanitizer needs more data than the limit: not shown here";
  constexpr int limit_mib = 12;
  constexpr int objects = 16;
  constexpr int views = 4 * limit_mib * (1 << 20) / (256 * 256) / objects;
  // The program's own data, two threads' stacks (8 MiB each), pictures being read and moved, the model.
  constexpr int program_mib = 40;
  for (int o = 0; o < objects; ++o) {
    ImageSetWriter writer(path("sets"), "thing" + std::to_string(o), turntable_workspace(), json::object(),
                          {.cropped = true, .sync_every_view = false});
    for (int v = 0; v < views; ++v) {
      const double angle = 6.283185307 * v / views;
      cv::Mat picture(32, 32, CV_8UC1);
      for (int y = 0; y < 32; ++y)
        for (int x = 0; x < 32; ++x)
          picture.at<std::uint8_t>(y, x) =
              static_cast<std::uint8_t>(120.0 + 60.0 * std::cos(angle + 0.2 * x + o) +
                                        40.0 * std::sin(2 * angle + 0.05 * o * y) + (x * y + v) % 7);
      writer.add(picture, {360.0 * v / views});
    }
    writer.finish();
  }
  const std::string learn = "learn sets --to a.model --size 256 --whole-region --components 3 --threads 1";
  const auto bounded = [&](const std::string& more) {
    return shell("cd '" + path("") + "' && ulimit -d " + std::to_string((limit_mib + program_mib) * 1024) +
                 " && '" + program + "' " + learn + more);
  };
  const Ended limited = bounded(" --memory-limit " + std::to_string(limit_mib));
  ASSERT_EQ(limited.code, 0) << limited.output;
  EXPECT_THAT(limited.output, HasSubstr("from " + std::to_string(objects * views) + " views"));
  const Ended unlimited = bounded("");
  EXPECT_EQ(unlimited.code, 1);
  EXPECT_THAT(unlimited.output, HasSubstr("out of memory")) << "the limit bites";
}

}  // namespace
}  // namespace eigenpose
