#include "core/model/hdf5_links.h"

namespace eigenpose {

void write_normalization(const Hdf5Group& group, const NormalizationOptions& options) {
  group.write("size", std::int64_t{options.size});
  group.write("color", std::int64_t{options.color});
  group.write("type", image_type_name(options));
  group.write("cropped", std::int64_t{options.cropped});
  group.write("least_contrast", std::int64_t{options.segmentation.least_contrast});
  group.write("noise_sigmas", options.segmentation.noise_sigmas);
  group.write("bridged_gap", std::int64_t{options.segmentation.bridged_gap});
  group.write("dirt_share", options.segmentation.dirt_share);
}

NormalizationOptions read_normalization(const Hdf5Group& group) {
  NormalizationOptions options;
  options.size = static_cast<int>(group.read_integer("size", 8, 256));
  set_image_type(options, group.read_text("type"));
  if (options.color != group.read_bool("color"))
    throw Hdf5Failure("has an image type that does not fit its colour");
  options.cropped = group.read_bool("cropped");
  options.segmentation.least_contrast = static_cast<int>(group.read_integer("least_contrast", 1, 200));
  options.segmentation.noise_sigmas = group.read_double("noise_sigmas");
  options.segmentation.bridged_gap = static_cast<int>(group.read_integer("bridged_gap", 0, 16));
  options.segmentation.dirt_share = group.read_double("dirt_share");
  return options;
}

void write_axis(const Hdf5Group& group, const SampleAxis& axis) {
  group.write("name", axis.dof.name);
  group.write("unit", axis.dof.unit);
  group.write("lower", axis.dof.lower);
  group.write("upper", axis.dof.upper);
  group.write("periodic", std::int64_t{axis.dof.periodic});
  group.write("samples", Eigen::MatrixXd(Eigen::Map<const Eigen::MatrixXd>(
                             axis.samples.data(), 1, static_cast<Eigen::Index>(axis.samples.size()))));
}

SampleAxis read_axis(const Hdf5Group& group) {
  const Dof dof{group.read_text("name"), group.read_text("unit"), group.read_double("lower"),
                group.read_double("upper"), group.read_bool("periodic")};
  const Eigen::MatrixXd samples = group.read_doubles("samples");
  return {dof, {samples.data(), samples.data() + samples.size()}};
}

}  // namespace eigenpose
