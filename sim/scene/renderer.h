#pragma once

/// Draws the lab as a camera sees it, in linear light.
///
/// Rays are cast at triangle meshes (Embree); light is the lamp on the arm (diffuse and glossy reflection,
/// soft shadows from its finite size), a dim room (with how open each point of a surface is), and what glossy
/// surfaces mirror of it. On request one bounce of light between surfaces. Edges are cast four times.

#include <memory>

#include <opencv2/core.hpp>

#include "sim/lab/scene_state.h"
#include "sim/scene/tracer.h"

namespace eigenpose::sim {

struct RenderOptions {
  int width = 640;       ///< pixels
  int height = 480;      ///< pixels
  unsigned threads = 1;  ///< 0: all cores
  int bounce_rays = 0;   ///< rays a point for light from other surfaces; 0: none, 16 looks well
};

/// One thread at a time. The picture is a function of the scene alone, whatever the threads.
class Renderer {
 public:
  /// @throws std::invalid_argument on a size out of 16…4096.
  explicit Renderer(RenderOptions options);
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;
  ~Renderer();

  [[nodiscard]] const RenderOptions& options() const { return options_; }
  /// CV_32FC3, blue, green, red, linear; 1 is what a white sheet on the table sends back under the full lamp,
  /// about. Objects unknown to the catalogue are left out.
  /// @param smooth false: one ray a pixel everywhere, for parts of a blur.
  [[nodiscard]] cv::Mat render(const SceneState& scene, bool smooth = true);

 private:
  struct Stage;
  struct Canvas;
  void light_stage(const Light& light);

  RenderOptions options_;
  Pinhole camera_;
  std::unique_ptr<Stage> stage_;    ///< the picture without objects, kept as long as the light stands
  std::unique_ptr<Canvas> canvas_;  ///< room to draw in
};

}  // namespace eigenpose::sim
