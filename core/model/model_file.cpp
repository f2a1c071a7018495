#include "core/model/model_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include <zlib.h>

#include "core/base/atomic_file.h"
#include "core/base/error.h"
#include "core/image/picture_file.h"
#include "core/model/hdf5_file.h"
#include "core/model/parts_file.h"

namespace eigenpose {
namespace {

constexpr std::size_t header_size = 512;  ///< HDF5 wants a power of two, at least 512
constexpr std::string_view magic = "eigenpose model\n";
constexpr int version = 3;

using Header = std::array<char, header_size>;

std::uint32_t checksum(std::span<const unsigned char> bytes) {
  uLong crc = crc32(0L, nullptr, 0);
  // zlib counts in 32 bits.
  constexpr std::size_t piece = 1U << 30;
  for (std::size_t at = 0; at < bytes.size(); at += piece)
    crc = crc32(crc, bytes.data() + at, static_cast<uInt>(std::min(piece, bytes.size() - at)));
  return static_cast<std::uint32_t>(crc);
}

/// The one header that belongs to this content; reading compares with it byte by byte.
Header make_header(std::span<const unsigned char> content) {
  Header header{};
  std::snprintf(header.data(), header.size(), "%sversion %d\ncontent_bytes %zu\ncontent_crc32 %08x\n",
                magic.data(), version, content.size(), checksum(content));
  return header;
}

/// The number after `key` in the header, or −1.
long header_number(std::string_view header, std::string_view key) {
  const auto at = header.find(key);
  long value = -1;
  if (at != std::string_view::npos)
    std::from_chars(header.data() + at + key.size(), header.data() + header.size(), value);
  return value;
}

void check_header(std::span<const unsigned char> bytes, const std::filesystem::path& file) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                              std::min(bytes.size(), header_size));
  if (!text.starts_with(magic))
    throw FileError(file, "is not an eigenpose model; 'eigenpose learn' makes them");
  if (const long found = header_number(text, "\nversion "); found != version)
    throw FileError(file, "is a model of version " + std::to_string(found) + ", this program reads version " +
                              std::to_string(version) + "; learn it again from its image sets");
  const long content = header_number(text, "\ncontent_bytes ");
  if (bytes.size() < header_size || content > static_cast<long>(bytes.size() - header_size))
    throw FileError(file, "is truncated; restore it from a copy or learn it again from its image sets");
  const Header expected = make_header(bytes.subspan(header_size));
  if (std::memcmp(expected.data(), bytes.data(), header_size) != 0)
    throw FileError(
        file, "is damaged (wrong checksum); restore it from a copy or learn it again from its image sets");
}

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
  options.size = static_cast<int>(group.read_integer("size"));
  set_image_type(options, group.read_text("type"));
  if (options.color != group.read_bool("color"))
    throw Hdf5Failure("has an image type that does not fit its colour");
  options.cropped = group.read_bool("cropped");
  options.segmentation.least_contrast = static_cast<int>(group.read_integer("least_contrast"));
  options.segmentation.noise_sigmas = group.read_double("noise_sigmas");
  options.segmentation.bridged_gap = static_cast<int>(group.read_integer("bridged_gap"));
  options.segmentation.dirt_share = group.read_double("dirt_share");
  return options;
}

void write_eigenspace(const Hdf5Group& group, const Eigenspace& eigenspace) {
  group.write("mean", Eigen::MatrixXf(eigenspace.mean));
  group.write("basis", eigenspace.basis);
  group.write("eigenvalues", Eigen::MatrixXd(eigenspace.eigenvalues));
  group.write("total_scatter", eigenspace.total_scatter);
}

Eigenspace read_eigenspace(const Hdf5Group& group) {
  Eigenspace eigenspace;
  eigenspace.mean = group.read_floats("mean");
  eigenspace.basis = group.read_floats("basis");
  eigenspace.eigenvalues = group.read_doubles("eigenvalues");
  eigenspace.total_scatter = group.read_double("total_scatter");
  return eigenspace;
}

void write_object(const Hdf5Group& group, const ModelObject& object) {
  group.write("name", object.name);
  group.write("rejection_distance", object.rejection_distance);
  group.write("typical_distance", object.typical_distance);
  group.write("pose_observable", std::int64_t{object.pose_observable});
  group.write("views", static_cast<std::int64_t>(object.views));
  group.write("degree", std::int64_t{object.manifold.degree()});
  group.write("coefficients", object.manifold.coefficients());
  if (object.space) {
    const Hdf5Group space = group.make_group("space");
    write_eigenspace(space, object.space->eigenspace);
    space.write("coefficients", object.space->manifold.coefficients());
    space.write("better_pose", std::int64_t{object.space->better_pose});
  }
  const Hdf5Group axes = group.make_group("axes");
  for (std::size_t d = 0; d < object.workspace.size(); ++d) {
    const Hdf5Group axis = axes.make_group(numbered(d));
    const Dof& dof = object.workspace[d];
    axis.write("name", dof.name);
    axis.write("unit", dof.unit);
    axis.write("lower", dof.lower);
    axis.write("upper", dof.upper);
    axis.write("periodic", std::int64_t{dof.periodic});
    axis.write("observable", std::int64_t{object.dof_observable.at(d)});
    const auto& samples = object.manifold.axes()[d].samples;
    axis.write("samples", Eigen::MatrixXd(Eigen::Map<const Eigen::MatrixXd>(
                              samples.data(), 1, static_cast<Eigen::Index>(samples.size()))));
  }
}

ModelObject read_object(const Hdf5Group& group) {
  std::vector<Dof> dofs;
  std::vector<SampleAxis> sample_axes;
  std::vector<bool> observable;
  const Hdf5Group axes = group.open_group("axes");
  for (const std::string& name : axes.group_names()) {
    const Hdf5Group axis = axes.open_group(name);
    const Dof dof{axis.read_text("name"), axis.read_text("unit"), axis.read_double("lower"),
                  axis.read_double("upper"), axis.read_bool("periodic")};
    const Eigen::MatrixXd samples = axis.read_doubles("samples");
    dofs.push_back(dof);
    sample_axes.push_back({dof, {samples.data(), samples.data() + samples.size()}});
    observable.push_back(axis.read_bool("observable"));
  }
  const int degree = static_cast<int>(group.read_integer("degree"));
  std::optional<ObjectSpace> space;
  const auto groups = group.group_names();
  if (std::find(groups.begin(), groups.end(), "space") != groups.end()) {
    const Hdf5Group own = group.open_group("space");
    space = ObjectSpace{read_eigenspace(own),
                        Manifold::from_coefficients(sample_axes, own.read_doubles("coefficients"), degree),
                        own.read_bool("better_pose")};
  }
  ModelObject object{
      group.read_text("name"), Workspace(std::move(dofs)),
      Manifold::from_coefficients(std::move(sample_axes), group.read_doubles("coefficients"), degree)};
  object.rejection_distance = group.read_double("rejection_distance");
  object.typical_distance = group.read_double("typical_distance");
  object.dof_observable = std::move(observable);
  object.pose_observable = group.read_bool("pose_observable");
  object.space = std::move(space);
  object.views = static_cast<std::size_t>(group.read_integer("views"));
  return object;
}

void write_content(const Model& model, const std::filesystem::path& part) {
  const Hdf5Lock lock;
  const Hdf5Handle file = create_hdf5(part, header_size);
  const Hdf5Group root = root_of(file);
  write_normalization(root.make_group("normalization"), model.normalization);
  write_eigenspace(root.make_group("eigenspace"), model.eigenspace);
  const Hdf5Group objects = root.make_group("objects");
  for (std::size_t i = 0; i < model.objects.size(); ++i)
    write_object(objects.make_group(numbered(i)), model.objects[i]);
  if (model.parts) write_parts(root.make_group("parts"), *model.parts);
  const Hdf5Group provenance = root.make_group("provenance");
  provenance.write("program_version", model.provenance.program_version);
  provenance.write("created", model.provenance.created);
  provenance.write("image_sets", model.provenance.image_sets);
  provenance.write("solver", model.provenance.solver);
  provenance.write("energy", model.provenance.energy);
}

Model read_content(std::span<unsigned char> bytes) {
  const Hdf5Lock lock;
  const Hdf5Handle file = open_hdf5(bytes);
  const Hdf5Group root = root_of(file);
  Model model;
  model.normalization = read_normalization(root.open_group("normalization"));
  model.eigenspace = read_eigenspace(root.open_group("eigenspace"));
  const Hdf5Group objects = root.open_group("objects");
  for (const std::string& name : objects.group_names())
    model.objects.push_back(read_object(objects.open_group(name)));
  if (root.has_group("parts"))
    model.parts = std::make_shared<const PartsModel>(read_parts(root.open_group("parts"), model.objects));
  const Hdf5Group provenance = root.open_group("provenance");
  model.provenance.program_version = provenance.read_text("program_version");
  model.provenance.created = provenance.read_text("created");
  model.provenance.image_sets = provenance.read_text("image_sets");
  model.provenance.solver = provenance.read_text("solver");
  model.provenance.energy = provenance.read_double("energy");
  return model;
}

bool fits(const Eigenspace& space, const Manifold& manifold, std::size_t length) {
  const auto n = static_cast<Eigen::Index>(length);
  return space.mean.size() == n && space.basis.rows() == n && space.components() >= 1 &&
         space.eigenvalues.size() == space.components() && manifold.dimensions() == space.components();
}

/// The parts fit together. @throws Hdf5Failure.
void check_shapes(const Model& model) {
  const NormalizationOptions& options = model.normalization;
  const int side = reduced_side(options);
  const auto reduced =
      static_cast<std::size_t>(side) * static_cast<std::size_t>(side * appearance_bands(options));
  bool good = !model.objects.empty();
  for (const ModelObject& object : model.objects) {
    good = good && fits(model.eigenspace, object.manifold, appearance_length(options));
    if (object.space) good = good && fits(object.space->eigenspace, object.space->manifold, reduced);
  }
  if (!good) throw Hdf5Failure("has parts that do not fit together");
}

}  // namespace

void save_model(const Model& model, const std::filesystem::path& file) {
  AtomicFile atomic(file);
  try {
    write_content(model, atomic.part());
  } catch (const Hdf5Failure& failure) {
    throw FileError(file, failure.what());
  }
  const auto bytes = read_file(atomic.part());
  const Header header = make_header(std::span(bytes).subspan(header_size));
  std::fstream part(atomic.part(), std::ios::in | std::ios::out | std::ios::binary);
  part.write(header.data(), header.size());
  part.close();
  if (!part) throw FileError(file, "cannot be written; is the disk full?");
  atomic.commit();
}

Model load_model(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file))
    throw FileError(file, "there is no such model; 'eigenpose learn' makes one");
  auto bytes = read_file(file);
  check_header(bytes, file);
  try {
    Model model = read_content(bytes);
    check_shapes(model);
    return model;
  } catch (const Hdf5Failure& failure) {
    throw FileError(file, std::string(failure.what()) + "; learn the model again from its image sets");
  } catch (const std::invalid_argument& failure) {
    throw FileError(file, std::string(failure.what()) + "; learn the model again from its image sets");
  }
}

}  // namespace eigenpose
