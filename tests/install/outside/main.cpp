// A program outside the tree, built against the installed package: draws two objects, learns them, and asks
// for a view that was not learned. Prints "NAME ANGLE" for it.

#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <numbers>

#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>

#include "core/dataset/image_set.h"
#include "core/learning/learning.h"
#include "core/model/model_file.h"
#include "core/recognition/recognizer.h"

namespace {

using namespace eigenpose;

/// An ellipse of which one end is bright, turned by `angle_deg`.
cv::Mat view(int width, double angle_deg) {
  cv::Mat picture(160, 160, CV_8UC1, cv::Scalar(0));
  cv::ellipse(picture, {80, 80}, {50, width}, angle_deg, 0, 360, cv::Scalar(120), cv::FILLED);
  const double angle = angle_deg * std::numbers::pi / 180.0;
  cv::circle(picture,
             {80 + static_cast<int>(std::lround(32 * std::cos(angle))),
              80 + static_cast<int>(std::lround(32 * std::sin(angle)))},
             11, cv::Scalar(250), cv::FILLED);
  return picture;
}

void write_turn(const char* folder, const char* name, int width) {
  const Workspace workspace = turntable_workspace();
  ImageSetWriter set(folder, name, workspace, nlohmann::json::object());
  for (int angle = 0; angle < 360; angle += 10) set.add(view(width, angle), {static_cast<double>(angle)});
  set.finish();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  try {
    write_turn(argv[1], "slim", 16);
    write_turn(argv[1], "stout", 34);
    LearningOptions options;
    options.normalization.size = 32;
    options.normalization.color = false;
    options.solver.components = 8;
    const std::string file = std::string(argv[1]) + "/outside.model";
    save_model(learn(all_views(open_image_sets(argv[1])), options), file);
    Recognizer recognizer(std::make_shared<const Model>(load_model(file)));
    for (const Outcome& outcome : recognizer.recognize(view(34, 125))) {
      if (!outcome.best) return 3;
      std::printf("%s %.0f\n", outcome.best->object.c_str(), outcome.best->q[0]);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "outside: %s\n", error.what());
    return 1;
  }
  return 0;
}
