#include "sim/scene/renderer.h"

#include <array>

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "sim/scene/catalog.h"

namespace eigenpose::sim {
namespace {

/// A table whose velvet sends back less than a hundredth of a white sheet's light: a value of 25 of 255 in a
/// camera.
constexpr double dark_table = 0.012;

const RenderOptions small{.width = 320, .height = 240};

SceneState scene_with(const std::string& object, double angle_deg) {
  SceneState scene;
  scene.objects = {{object, angle_deg, 0.0, 0.0, 0.0}};
  return scene;
}

/// Mean absolute difference over the brighter picture's mean: 0 the same, about 1 unrelated.
double relative_difference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L1) / std::max(cv::norm(a, cv::NORM_L1), cv::norm(b, cv::NORM_L1));
}

cv::Mat foreground(const cv::Mat& picture) {
  std::vector<cv::Mat> bands;
  cv::split(picture, bands);
  return cv::Mat(cv::max(cv::max(bands[0], bands[1]), bands[2]) > 2.0 * dark_table);
}

TEST(Renderer, AnEmptyTableIsDarkEverywhere) {
  Renderer renderer(small);
  const cv::Mat picture = renderer.render({});
  double most = 0.0;
  cv::minMaxLoc(picture.reshape(1), nullptr, &most);
  EXPECT_LT(most, dark_table);
  EXPECT_GT(cv::mean(picture)[1], 0.0005);
}

TEST(Renderer, EveryObjectStandsOutAndFitsIntoThePictureAtEveryAngle) {
  Renderer renderer({.width = 160, .height = 120});
  for (const ObjectDescription& object : built_objects()) {
    for (const double angle : {0.0, 90.0, 180.0, 270.0}) {
      const cv::Mat mask = foreground(renderer.render(scene_with(object.name, angle)));
      EXPECT_GT(cv::countNonZero(mask), 400) << object.name << " at " << angle;
      cv::Mat inner = mask.clone();
      inner(cv::Rect(2, 2, 156, 116)).setTo(0);
      EXPECT_EQ(cv::countNonZero(inner), 0) << object.name << " at " << angle << " touches the border";
    }
  }
}

TEST(Renderer, EveryObjectWhosePoseCanBeSeenLooksDifferentTenDegreesOn) {
  Renderer renderer({.width = 160, .height = 120});
  for (const ObjectDescription& object : built_objects()) {
    if (object.symmetric) continue;
    for (const double angle : {5.0, 100.0, 190.0, 285.0}) {
      const double change = relative_difference(renderer.render(scene_with(object.name, angle)),
                                                renderer.render(scene_with(object.name, angle + 10.0)));
      EXPECT_GT(change, 0.05) << object.name << " at " << angle;
    }
  }
}

TEST(Renderer, ASymmetricObjectLooksTheSameAtEveryAngle) {
  Renderer renderer(small);
  const cv::Mat first = renderer.render(scene_with("bottle", 0.0));
  for (const double angle : {13.0, 45.0, 171.3, 300.0}) {
    // Its mesh is no perfect solid of revolution: a hundredth is less than the camera's noise.
    EXPECT_LT(relative_difference(first, renderer.render(scene_with("bottle", angle))), 0.01) << angle;
  }
}

TEST(Renderer, TheLightArmChangesThePictureAndItsShadow) {
  Renderer renderer(small);
  SceneState left = scene_with("duck", 30.0);
  SceneState right = left;
  right.light_azimuth_deg = 90.0;
  SceneState high = left;
  high.light_elevation_deg = 80.0;
  EXPECT_GT(relative_difference(renderer.render(left), renderer.render(right)), 0.1);
  EXPECT_GT(relative_difference(renderer.render(left), renderer.render(high)), 0.05);
  SceneState dark = left;
  dark.lamp_level = 0.0;
  EXPECT_LT(cv::mean(renderer.render(dark))[1], 0.6 * cv::mean(renderer.render(left))[1]);
}

TEST(Renderer, TurningTheObjectIsNotTurningTheLight) {
  Renderer renderer(small);
  SceneState turned_light = scene_with("car", 20.0);
  turned_light.light_azimuth_deg = -40.0;
  EXPECT_GT(relative_difference(renderer.render(scene_with("car", 60.0)), renderer.render(turned_light)),
            0.1);
}

TEST(Renderer, TwinsDifferOnlyWhereTheyShould) {
  Renderer renderer(small);
  const auto difference = [&](const char* a, const char* b, double angle) {
    return relative_difference(renderer.render(scene_with(a, angle)), renderer.render(scene_with(b, angle)));
  };
  EXPECT_GT(difference("mug", "mug_blue", 30.0), 0.3);       // all over, but in colour only
  EXPECT_GT(difference("pig", "pig_patched", 270.0), 0.02);  // a patch
  EXPECT_LT(difference("pig", "pig_patched", 270.0), 0.2);
  EXPECT_GT(difference("block_a", "block_b", 0.0), 0.01);     // a letter
  EXPECT_LT(difference("block_a", "block_b", 180.0), 0.001);  // the same from behind
  cv::Mat grey_red;
  cv::Mat grey_blue;
  cv::Mat(foreground(renderer.render(scene_with("mug", 30.0)))).copyTo(grey_red);
  cv::Mat(foreground(renderer.render(scene_with("mug_blue", 30.0)))).copyTo(grey_blue);
  EXPECT_LT(cv::countNonZero(grey_red != grey_blue), 40);  // one outline
}

TEST(Renderer, ThreadsDoNotChangeThePicture) {
  Renderer one({.width = 320, .height = 240, .threads = 1});
  Renderer three({.width = 320, .height = 240, .threads = 3});
  const SceneState scene = scene_with("boat", 77.0);
  EXPECT_EQ(cv::norm(one.render(scene), three.render(scene), cv::NORM_INF), 0.0);
}

TEST(Renderer, AHandIsSeenAndObjectsHideEachOther) {
  Renderer renderer(small);
  SceneState scene = scene_with("duck", 0.0);
  const cv::Mat alone = renderer.render(scene);
  scene.hand = 0.9;
  EXPECT_GT(relative_difference(alone, renderer.render(scene)), 0.2);
  scene.hand.reset();
  scene.objects.push_back({"car", 0.0, 0.0, -60.0, 0.0});  // in front
  const cv::Mat both = renderer.render(scene);
  scene.objects.erase(scene.objects.begin());
  const cv::Mat front = renderer.render(scene);
  // Where the front object is seen it is seen unchanged; at its outline a pixel mixes both.
  const cv::Mat mask = foreground(front);
  cv::Mat inner;
  cv::erode(mask, inner, cv::Mat(), {-1, -1}, 3);
  EXPECT_LT(cv::norm(both, front, cv::NORM_L1, inner) / cv::norm(front, cv::NORM_L1, inner), 0.03);
}

TEST(Renderer, AHandComesInFromOutsideThePicture) {
  for (const cv::Size size : {cv::Size(320, 240), cv::Size(64, 240), cv::Size(240, 64)}) {
    Renderer renderer({.width = size.width, .height = size.height});
    SceneState scene = scene_with("duck", 0.0);
    const cv::Mat alone = renderer.render(scene);
    double before = 0.0;
    bool came = false;
    for (const double reach : {0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0}) {
      scene.hand = reach;
      const double change = relative_difference(alone, renderer.render(scene));
      if (reach == 0.0) {
        EXPECT_EQ(change, 0.0) << "outside the picture, and yet seen";
      }
      came = came || change > 0.05;
      EXPECT_GE(change, 0.5 * before) << "at " << reach;
      before = change;
    }
    EXPECT_TRUE(came) << size;
  }
}

TEST(Renderer, WhatStandsOutsideThePictureIsNotSeenAndDoesNoHarm) {
  Renderer renderer({.width = 160, .height = 120});
  const cv::Mat empty = renderer.render({});
  for (const auto& [x, y, z] : {std::array{-900.0, 0.0, 0.0},
                                {900.0, 0.0, 0.0},
                                {0.0, 900.0, 900.0},
                                {0.0, -900.0, -900.0},
                                {0.0, 0.0, 1200.0},
                                {900.0, 900.0, 900.0},
                                {0.0, -2200.0, 1500.0}}) {
    SceneState scene;
    scene.objects = {{"duck", 10.0, x, y, z}};
    const cv::Mat picture = renderer.render(scene);
    EXPECT_LT(relative_difference(empty, picture), 0.5) << x << ", " << y << ", " << z;
    EXPECT_EQ(cv::countNonZero(foreground(picture)), 0) << x << ", " << y << ", " << z;
  }
}

TEST(Renderer, AnObjectAtTheBorderIsCutThere) {
  Renderer renderer({.width = 160, .height = 120});
  SceneState scene = scene_with("mug", 0.0);
  const int whole = cv::countNonZero(foreground(renderer.render(scene)));
  scene.objects[0].x_mm = -150.0;  // half of the field's width
  const cv::Mat mask = foreground(renderer.render(scene));
  EXPECT_GT(cv::countNonZero(mask), whole / 4);
  EXPECT_LT(cv::countNonZero(mask), 3 * whole / 4);
  EXPECT_GT(cv::countNonZero(mask.col(0)), 0) << "nothing touches the border";
}

TEST(Renderer, BouncedLightOnlyAdds) {
  Renderer plain({.width = 160, .height = 120});
  Renderer bounced({.width = 160, .height = 120, .bounce_rays = 8});
  const SceneState scene = scene_with("mug", 30.0);
  const cv::Mat a = plain.render(scene);
  const cv::Mat b = bounced.render(scene);
  EXPECT_GT(cv::mean(b)[2], 1.005 * cv::mean(a)[2]);
  EXPECT_LT(cv::mean(b)[2], 1.3 * cv::mean(a)[2]);
}

TEST(Renderer, RefusesSizesItCannotDraw) {
  EXPECT_THROW(Renderer({.width = 3, .height = 100}), std::invalid_argument);
  EXPECT_THROW(Renderer({.width = 641, .height = 480}), std::invalid_argument);
  EXPECT_THROW(Renderer({.bounce_rays = 3}), std::invalid_argument);
}

}  // namespace
}  // namespace eigenpose::sim
