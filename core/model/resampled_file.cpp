#include "core/model/resampled_file.h"

#include <stdexcept>
#include <string>

#include "core/base/atomic_file.h"
#include "core/base/error.h"
#include "core/manifold/resample.h"
#include "core/model/hdf5_output.h"

namespace eigenpose {
namespace {

void write_group(const Hdf5Group& group, const ModelObject& object, const ResamplingOptions& options) {
  const ResampledManifold resampled = resample(object.manifold, resampling_counts(object.manifold, options));
  std::string axes;
  for (std::size_t d = 0; d < object.workspace.size(); ++d)
    axes += (d > 0 ? ", " : "") + object.workspace[d].name + " [" + object.workspace[d].unit + "]";
  group.write("axes", axes);
  group.write("degree", std::int64_t{object.manifold.degree()});
  group.write("q", resampled.q);
  group.write("points", resampled.points);
}

void write_hdf5(const Model& model, std::span<const std::size_t> objects, const ResamplingOptions& options,
                const std::filesystem::path& file) {
  AtomicFile atomic(file);
  write_hdf5(atomic, 0, [&](const Hdf5Group& root) {
    for (const std::size_t o : objects)
      write_group(root.make_group(model.objects[o].name), model.objects[o], options);
  });
  atomic.commit();
}

}  // namespace

std::vector<std::size_t> resampling_counts(const Manifold& manifold, const ResamplingOptions& options) {
  if (options.per_turn == 0 || options.per_step == 0)
    throw std::invalid_argument("resampling wants at least one point a turn and a step, got " +
                                std::to_string(options.per_turn) + " and " +
                                std::to_string(options.per_step));
  std::vector<std::size_t> counts;
  for (const SampleAxis& axis : manifold.axes())
    counts.push_back(axis.dof.periodic ? options.per_turn : options.per_step * (axis.samples.size() - 1) + 1);
  return counts;
}

std::vector<std::filesystem::path> write_resampled(const Model& model, std::span<const std::size_t> objects,
                                                   const ResamplingOptions& options,
                                                   const std::filesystem::path& file) {
  if (file.extension() == ".h5") {
    write_hdf5(model, objects, options, file);
    return {file};
  }
  if (file.extension() != ".csv")
    throw FileError(file, "is neither .h5 (HDF5) nor .csv (a table); give one of these endings");
  std::vector<std::filesystem::path> written;
  for (const std::size_t o : objects) {
    const ModelObject& object = model.objects[o];
    auto name = file;
    if (objects.size() > 1) name.replace_filename(file.stem().string() + "-" + object.name + ".csv");
    write_csv(name, object.manifold, resample(object.manifold, resampling_counts(object.manifold, options)));
    written.push_back(name);
  }
  return written;
}

}  // namespace eigenpose
