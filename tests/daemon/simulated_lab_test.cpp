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

std::string error_of(const JobStatus& job) {
  return job.failure.value_or(Failure{}).what;
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
    ASSERT_EQ(job.state, JobState::done) << error_of(job);
    EXPECT_EQ(job.total, 24U);
  }
  const JobStatus learned = lab.learn();
  ASSERT_EQ(learned.state, JobState::done) << error_of(learned);
}

/// Puts them on the table one after the other, turned between two learned poses, which are 15 degrees apart.
void expect_duck_and_car_recognized(LabService& lab) {
  constexpr double pose_bound_deg = 5.0;  // small pictures, so a coarse bound
  for (const auto& [object, yaw_deg] : {std::pair{"duck", 52.0}, {"car", 203.0}}) {
    const SceneResult result = lab.seen_after([&, object = object, yaw_deg = yaw_deg] {
      lab.lab().clear();
      lab.lab().place(object, degrees(yaw_deg));
    });
    ASSERT_EQ(result.outcomes.size(), 1U) << log_text(result);
    const Outcome& outcome = result.outcomes[0];
    ASSERT_EQ(outcome.verdict, Verdict::recognized) << log_text(result);
    EXPECT_EQ(outcome.best->object, object);
    EXPECT_LT(std::abs(circular_difference(outcome.best->q[0], yaw_deg, 360.0)), pose_bound_deg);
  }
}

TEST(SimulatedLab, AcquiresLearnsAndSaysWhatStandsThereAndHowItIsTurned) {
  LabService lab(small_lab + table_at("simulated"));
  ASSERT_NO_FATAL_FAILURE(learn_duck_and_car(lab));
  EXPECT_TRUE(std::filesystem::exists(lab.config().model_file()));
  ASSERT_NO_FATAL_FAILURE(expect_duck_and_car_recognized(lab));
  const SceneResult empty = lab.seen_after([&] { lab.lab().clear(); });
  EXPECT_TRUE(empty.outcomes.empty()) << "an empty table is no object: " << log_text(empty);

  const SceneResult hand = lab.seen_after([&] { lab.lab().hand(true); });
  for (const Outcome& outcome : hand.outcomes)
    EXPECT_NE(outcome.verdict, Verdict::recognized) << "a hand is no object: " << log_text(hand);
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
  EXPECT_THAT(error_of(job), HasSubstr("table"));
  EXPECT_THAT(error_of(job), HasSubstr("127.0.0.1:1"));
  EXPECT_THAT(job.failure->hint, HasSubstr("has power and its cable"));
  EXPECT_THAT(lab.service().rig().status().axes[0].error.value_or(""), HasSubstr("table"));
}

TEST(SimulatedLab, AModbusServerThatDiesInTheMiddleLosesNothingAndTheAcquisitionContinues) {
  LabService lab(small_lab + table_at("simulated"));
  lab.lab().clear();
  lab.lab().place("duck");
  const std::string id = lab.service().acquire("duck", "default").id;
  ASSERT_EQ(lab.done_steps(id, 3).state, JobState::running);
  lab.lab().request(R"({"do": "modbus", "alive": false})");
  const JobStatus broken = lab.ended(id);
  EXPECT_EQ(broken.state, JobState::failed);
  EXPECT_THAT(error_of(broken), HasSubstr("table"));
  EXPECT_THAT(broken.failure->hint, HasSubstr("of 24 views are kept"));
  const ImageSet partial = ImageSet::open(lab.config().image_sets() / "duck");
  EXPECT_GE(partial.views().size(), 3U);
  EXPECT_FALSE(partial.complete());
  for (std::size_t i = 0; i < partial.views().size(); ++i) EXPECT_NO_THROW(partial.load(i));
  // Nobody speaks to the drive any more: its own watchdog, armed for the move, stops it.
  while (lab.lab().truth().moving) std::this_thread::yield();

  lab.lab().request(R"({"do": "modbus", "alive": true})");
  const JobStatus continued = lab.acquire("duck");
  EXPECT_EQ(continued.state, JobState::done) << error_of(continued);
  const ImageSet whole = ImageSet::open(lab.config().image_sets() / "duck");
  EXPECT_EQ(whole.views().size(), 24U);
  EXPECT_TRUE(whole.complete());
}

TEST(SimulatedLab, CancellingStopsTheTableAndKeepsWhatWasTaken) {
  LabService lab(small_lab + table_at("simulated"));
  lab.lab().clear();
  lab.lab().place("duck");
  const std::string id = lab.service().acquire("duck", "default").id;
  lab.done_steps(id, 2);
  ASSERT_TRUE(lab.service().jobs().cancel(id));
  EXPECT_EQ(lab.ended(id).state, JobState::cancelled);
  // The drive was told to stop and slows down; nobody sends it on to the next pose.
  while (lab.lab().truth().moving) std::this_thread::yield();
  const ImageSet kept = ImageSet::open(lab.config().image_sets() / "duck");
  EXPECT_GE(kept.views().size(), 2U);
  EXPECT_LT(kept.views().size(), 24U);
  // It stands short of the pose after the last one that was taken or under way: 15 degrees each.
  const double rest_deg = lab.lab().truth().table.degrees();
  EXPECT_LE(rest_deg, 15.0 * static_cast<double>(kept.views().size()) + 1.0);
}

}  // namespace
}  // namespace eigenpose
