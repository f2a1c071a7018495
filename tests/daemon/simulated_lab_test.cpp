/// The main path in one process: real drivers, simulated lab.

#include <cmath>
#include <fstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/angle.h"
#include "core/dataset/image_set.h"
#include "core/model/model_file.h"
#include "tests/daemon/lab_service.h"

namespace eigenpose {
namespace {

using testing::HasSubstr;

/// Small pictures and a fast table, so that a test takes seconds.
const std::string small_lab = R"(
[sim]
speed_factor = 50.0
[camera]
driver = "simulated"
width = 320
height = 240
frames_per_second = 50.0
[watch]
settle_ms = 100
[[plan]]
name = "default"
[[plan.axis]]
axis = "table"
from = 0.0
to = 360.0
count = 24
)";

std::string table_at(const std::string& endpoint) {
  return "[[axis]]\nname = \"table\"\ndriver = \"modbus\"\nsettle_ms = 10\nendpoint = \"" + endpoint + "\"\n";
}

bool has_part_files(const std::filesystem::path& folder) {
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.path().string().find(".part") != std::string::npos) return true;
  return false;
}

/// Acquires a duck and a car, and learns them.
void learn_duck_and_car(LabService& lab) {
  for (const char* object : {"duck", "car"}) {
    const JobStatus job = lab.acquire(object);
    ASSERT_EQ(job.state, JobState::done) << job.error;
    EXPECT_EQ(job.total, 24U);
  }
  const JobStatus learned = lab.learn();
  ASSERT_EQ(learned.state, JobState::done) << learned.error;
}

/// Puts them on the table one after the other, turned between two learned poses, which are 15 degrees apart.
void expect_duck_and_car_recognized(LabService& lab) {
  constexpr double pose_bound_deg = 5.0;  // small pictures, so a coarse bound
  for (const auto& [object, yaw_deg] : {std::pair{"duck", 52.0}, {"car", 203.0}}) {
    const nlohmann::json result = lab.seen_after([&] {
      lab.lab().clear();
      lab.lab().place(object, degrees(yaw_deg));
    });
    ASSERT_EQ(result.at("outcomes").size(), 1U) << result.dump();
    const nlohmann::json& outcome = result.at("outcomes")[0];
    EXPECT_EQ(outcome.at("verdict"), "recognized") << result.dump();
    EXPECT_EQ(outcome.at("object"), object);
    EXPECT_LT(std::abs(circular_difference(outcome.at("pose").at("table_deg").get<double>(), yaw_deg, 360.0)),
              pose_bound_deg);
  }
}

TEST(SimulatedLab, AcquiresLearnsAndSaysWhatStandsThereAndHowItIsTurned) {
  LabService lab(small_lab + table_at("simulated"));
  ASSERT_NO_FATAL_FAILURE(learn_duck_and_car(lab));
  EXPECT_TRUE(std::filesystem::exists(lab.config().model_file()));
  ASSERT_NO_FATAL_FAILURE(expect_duck_and_car_recognized(lab));
  const nlohmann::json empty = lab.seen_after([&] { lab.lab().clear(); });
  EXPECT_TRUE(empty.at("outcomes").empty()) << "an empty table is no object: " << empty.dump();

  const nlohmann::json hand = lab.seen_after([&] { lab.lab().hand(true); });
  for (const nlohmann::json& outcome : hand.at("outcomes"))
    EXPECT_NE(outcome.at("verdict"), "recognized") << "a hand is no object: " << hand.dump();
  EXPECT_FALSE(has_part_files(lab.config().daemon.state_dir));
}

TEST(SimulatedLab, LearnsAndWatchesByTheImageTypeThatItsConfigurationNames) {
  LabService lab("[learn]\ntype = \"gradient\"\n" + small_lab + table_at("simulated"));
  ASSERT_NO_FATAL_FAILURE(learn_duck_and_car(lab));
  EXPECT_EQ(image_type_name(load_model(lab.config().model_file()).normalization), "gradient");
  expect_duck_and_car_recognized(lab);
}

TEST(SimulatedLab, AnAbsentModbusServerEndsInAClearErrorAndNothingIsLost) {
  // Port 1 of this machine: nobody serves there.
  LabService lab(small_lab + table_at("tcp://127.0.0.1:1"));
  const JobStatus job = lab.acquire("duck");
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_THAT(job.error, HasSubstr("table"));
  EXPECT_THAT(job.error, HasSubstr("127.0.0.1:1"));
  EXPECT_THAT(job.hint, HasSubstr("has power and its cable"));
  EXPECT_THAT(lab.service().rig().status()[0].error.value_or(""), HasSubstr("table"));
}

TEST(SimulatedLab, AModbusServerThatDiesInTheMiddleLosesNothingAndTheAcquisitionContinues) {
  LabService lab(small_lab + table_at("simulated"));
  lab.lab().clear();
  lab.lab().place("duck");
  const std::string id = lab.service().acquire("duck", lab.service().plan("default")).id;
  ASSERT_EQ(lab.done_steps(id, 3).state, JobState::running);
  lab.lab().request(R"({"do": "modbus", "alive": false})");
  const JobStatus broken = lab.ended(id);
  EXPECT_EQ(broken.state, JobState::failed);
  EXPECT_THAT(broken.error, HasSubstr("table"));
  EXPECT_THAT(broken.hint, HasSubstr("of 24 views are kept"));
  const ImageSet partial = ImageSet::open(lab.config().image_sets() / "duck");
  EXPECT_GE(partial.views().size(), 3U);
  EXPECT_FALSE(partial.complete());
  for (std::size_t i = 0; i < partial.views().size(); ++i) EXPECT_NO_THROW(partial.load(i));
  // Nobody speaks to the drive any more: its own watchdog, armed for the move, stops it.
  while (lab.lab().truth().moving) std::this_thread::yield();

  lab.lab().request(R"({"do": "modbus", "alive": true})");
  const JobStatus continued = lab.acquire("duck");
  EXPECT_EQ(continued.state, JobState::done) << continued.error;
  const ImageSet whole = ImageSet::open(lab.config().image_sets() / "duck");
  EXPECT_EQ(whole.views().size(), 24U);
  EXPECT_TRUE(whole.complete());
}

TEST(SimulatedLab, CancellingStopsTheTableAndKeepsWhatWasTaken) {
  LabService lab(small_lab + table_at("simulated"));
  lab.lab().clear();
  lab.lab().place("duck");
  const std::string id = lab.service().acquire("duck", lab.service().plan("default")).id;
  lab.done_steps(id, 2);
  ASSERT_TRUE(lab.service().jobs().cancel(id));
  EXPECT_EQ(lab.ended(id).state, JobState::cancelled);
  // The drive was told to stop and slows down; nobody sends it on to the next pose.
  while (lab.lab().truth().moving) std::this_thread::yield();
  const Angle rest = lab.lab().truth().table;
  EXPECT_EQ(lab.lab().truth().table, rest);
  EXPECT_GE(ImageSet::open(lab.config().image_sets() / "duck").views().size(), 2U);
}

TEST(SimulatedLab, LearningWithoutACompleteSetSaysToAcquireFirst) {
  LabService lab(small_lab + table_at("simulated"));
  const JobStatus job = lab.learn();
  EXPECT_EQ(job.state, JobState::failed);
  EXPECT_FALSE(job.error.empty());
}

TEST(SimulatedLab, ADamagedModelIsToldAndLeftWhereItIs) {
  test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "model.h5";
  std::ofstream(file) << "not a model";
  ModelStore store(file);
  store.load();
  EXPECT_EQ(store.current(), nullptr);
  EXPECT_THAT(store.error().value_or(""), HasSubstr(file.string()));
  EXPECT_EQ(std::filesystem::file_size(file), 11U);
}

}  // namespace
}  // namespace eigenpose
