/// Every fact under its own key: no two of one kind have the same value here.

#include "daemon/api/json.h"

#include <chrono>
#include <optional>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace eigenpose {
namespace {

using nlohmann::json;

TEST(ApiJson, EveryFactOfTheCameraStandsUnderItsOwnKey) {
  CameraStatus camera;
  EXPECT_EQ(to_json(camera), json(nullptr)) << "there is none";
  camera.configured = true;
  const json silent = {{"error", nullptr},
                       {"frames_taken", 0},
                       {"frames_dropped", 0},
                       {"frames_damaged", 0},
                       {"damaged_by", json::object()},
                       {"times_lost", 0},
                       {"frame_sequence", nullptr},
                       {"frame_age_s", nullptr}};
  EXPECT_EQ(to_json(camera), silent) << "it was never opened";

  camera.error = "gone";
  camera.statistics = {.frames_taken = 11, .frames_dropped = 12, .frames_damaged = 13, .times_lost = 14};
  camera.statistics.damaged_by.at(static_cast<std::size_t>(FrameFault::cut_short)) = 6;
  camera.statistics.damaged_by.at(static_cast<std::size_t>(FrameFault::too_short)) = 7;
  camera.frame_sequence = 15;
  camera.frame_age = std::chrono::milliseconds(1600);
  camera.info = CameraInfo{"top", "Model", "", "YUYV", 640, 480, 29.97, {{"gain", 17}}};
  json opened = {
      {"error", "gone"},
      {"frames_taken", 11},
      {"frames_dropped", 12},
      {"frames_damaged", 13},
      {"damaged_by",
       {{std::string(name_of(FrameFault::cut_short)), 6}, {std::string(name_of(FrameFault::too_short)), 7}}},
      {"times_lost", 14},
      {"frame_sequence", 15},
      {"frame_age_s", 1.6},
      {"name", "top"},
      {"model", "Model"},
      {"serial", nullptr},
      {"format", "YUYV"},
      {"width", 640},
      {"height", 480},
      {"frames_per_second", 29.97},
      {"controls", {{"gain", 17}}}};
  EXPECT_EQ(to_json(camera), opened);
  camera.info->serial = "S1";
  opened["serial"] = "S1";
  EXPECT_EQ(to_json(camera), opened);
}

TEST(ApiJson, EveryFactOfAnAxisStandsUnderItsOwnKey) {
  AxisStatus axis{{"arm", "mm", -3.0, 80.0, false}, "", std::nullopt, "no answer"};
  json expected = {{"name", "arm"},     {"unit", "mm"},     {"lower", -3.0},        {"upper", 80.0},
                   {"periodic", false}, {"model", nullptr}, {"error", "no answer"}, {"position", nullptr},
                   {"moving", false},   {"homed", false},   {"alarm", nullptr}};
  EXPECT_EQ(to_json(axis), expected);
  axis.model = "AZ";
  axis.error.reset();
  for (const bool moving : {true, false}) {
    axis.state = AxisState{12.5, moving, !moving, "overload"};
    expected.update({{"model", "AZ"},
                     {"error", nullptr},
                     {"position", 12.5},
                     {"moving", moving},
                     {"homed", !moving},
                     {"alarm", "overload"}});
    EXPECT_EQ(to_json(axis), expected);
  }
}

TEST(ApiJson, EveryFactOfAJobStandsUnderItsOwnKey) {
  JobStatus job;
  job.id = "7";
  job.kind = JobKind::learn;
  job.started = std::chrono::system_clock::time_point(std::chrono::milliseconds(1'000'000'000'500));
  json expected = {{"id", "7"},
                   {"kind", "learn"},
                   {"subject", nullptr},
                   {"state", "running"},
                   {"stage", nullptr},
                   {"done", 0},
                   {"total", 0},
                   {"error", nullptr},
                   {"hint", nullptr},
                   {"result", nullptr},
                   {"started", "2001-09-09T01:46:40.500Z"},
                   {"ended", nullptr}};
  EXPECT_EQ(to_json(job), expected);
  job.kind = JobKind::acquire;
  job.subject = "mug";
  job.state = JobState::failed;
  job.stage = "acquiring";
  job.done = 3;
  job.total = 36;
  job.failure = Failure{Fault::device, "what", "hint"};
  job.ended = job.started + std::chrono::seconds(2);
  job.result = AcquisitionResult{"/s/mug", 21, 22, 23, std::nullopt};
  expected = {
      {"id", "7"},
      {"kind", "acquire"},
      {"subject", "mug"},
      {"state", "failed"},
      {"stage", "acquiring"},
      {"done", 3},
      {"total", 36},
      {"error", "what"},
      {"hint", "hint"},
      {"result",
       {{"folder", "/s/mug"}, {"views", 21}, {"kept", 22}, {"retaken", 23}, {"not_returned", nullptr}}},
      {"started", "2001-09-09T01:46:40.500Z"},
      {"ended", "2001-09-09T01:46:42.500Z"}};
  EXPECT_EQ(to_json(job), expected);
  job.result = AcquisitionResult{"/s/mug", 21, 22, 23, "stuck"};
  EXPECT_EQ(to_json(job)["result"]["not_returned"], "stuck");
}

TEST(ApiJson, TheResultOfLearningSaysWhatWasLeftOutAndWhy) {
  JobStatus job;
  job.result = LearningResult{31,
                              32,
                              33,
                              0.75,
                              std::chrono::duration<double>(4.5),
                              "/s/model.h5",
                              {"cup"},
                              {{"cup", true, 4, "too dark"}, {"mug", false, 2, "cut off"}}};
  EXPECT_EQ(to_json(job)["result"],
            (json{{"objects", 31},
                  {"views", 32},
                  {"components", 33},
                  {"energy", 0.75},
                  {"seconds", 4.5},
                  {"file", "/s/model.h5"},
                  {"left_out", {"cup"}},
                  {"left_out_details",
                   {{{"object", "cup"}, {"whole_object", true}, {"views", 4}, {"reason", "too dark"}},
                    {{"object", "mug"}, {"whole_object", false}, {"views", 2}, {"reason", "cut off"}}}}}));
}

}  // namespace
}  // namespace eigenpose
