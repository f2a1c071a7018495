#include "core/model/model_file.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/atomic_file.h"
#include "core/base/error.h"
#include "core/model/hdf5_file.h"
#include "core/model/hdf5_links.h"
#include "core/model/hdf5_output.h"
#include "core/model/model_check.h"
#include "core/model/parts_file.h"
#include "core/model/sealed_file.h"

namespace eigenpose {
namespace {

constexpr SealedFormat model_format{"eigenpose model\n", 5,
                                    "is not an eigenpose model; 'eigenpose learn' makes them",
                                    "learn it again from its image sets"};

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
    write_axis(axis, object.manifold.axes()[d]);
    axis.write("observable", std::int64_t{object.dof_observable.at(d)});
  }
}

ModelObject read_object(const Hdf5Group& group) {
  std::vector<Dof> dofs;
  std::vector<SampleAxis> sample_axes;
  std::vector<bool> observable;
  const Hdf5Group axes = group.open_group("axes");
  for (const std::string& name : axes.group_names()) {
    const Hdf5Group axis = axes.open_group(name);
    sample_axes.push_back(read_axis(axis));
    dofs.push_back(sample_axes.back().dof);
    observable.push_back(axis.read_bool("observable"));
  }
  const int degree = static_cast<int>(group.read_integer("degree", 1, 3));
  std::optional<ObjectEigenspace> space;
  if (group.has("space")) {
    const Hdf5Group own = group.open_group("space");
    space =
        ObjectEigenspace{read_eigenspace(own),
                         Manifold::from_coefficients(sample_axes, own.read_doubles("coefficients"), degree),
                         own.read_bool("better_pose")};
  }
  ModelObject object{
      group.read_text("name"), Workspace(std::move(dofs)),
      Manifold::from_coefficients(std::move(sample_axes), group.read_doubles("coefficients"), degree)};
  object.typical_distance = group.read_double("typical_distance");
  object.dof_observable = std::move(observable);
  object.pose_observable = group.read_bool("pose_observable");
  object.space = std::move(space);
  object.views = static_cast<std::size_t>(group.read_integer("views", 0, std::int64_t{1} << 31));
  return object;
}

template <std::size_t n>
void write_weights(const Hdf5Group& group, const std::string& name, const std::array<double, n>& weights) {
  group.write(name, Eigen::MatrixXd(Eigen::Map<const Eigen::VectorXd>(weights.data(), n)));
}

template <std::size_t n>
void read_weights(const Hdf5Group& group, const std::string& name, std::array<double, n>& weights) {
  const Eigen::MatrixXd read = group.read_doubles(name);
  if (read.size() != static_cast<Eigen::Index>(n))
    throw std::invalid_argument("the weights of the evidence are " + std::to_string(read.size()) +
                                " instead of " + std::to_string(n));
  std::copy_n(read.data(), n, weights.begin());
}

void write_evidence(const Hdf5Group& group, const std::string& name, const std::vector<double>& evidence) {
  group.write(name, Eigen::MatrixXd(Eigen::Map<const Eigen::VectorXd>(
                        evidence.data(), static_cast<Eigen::Index>(evidence.size()))));
}

std::vector<double> read_evidence(const Hdf5Group& group, const std::string& name) {
  const Eigen::MatrixXd read = group.read_doubles(name);
  return {read.data(), read.data() + read.size()};
}

void write_decision(const Hdf5Group& group, const DecisionModel& decision) {
  write_weights(group, "whole_weights", decision.weights.whole);
  write_weights(group, "windows_weights", decision.weights.windows);
  write_weights(group, "occluded_weights", decision.weights.occluded);
  group.write("required", decision.required);
  group.write("required_occluded", decision.required_occluded);
  group.write("settled", decision.settled);
  group.write("held_for_acceptance", std::int64_t{decision.held_for_acceptance});
  group.write("set_false_rejection", decision.set.false_rejection);
  group.write("set_false_acceptance", decision.set.false_acceptance);
  group.write("expected_false_rejection", decision.expected.false_rejection);
  group.write("expected_false_acceptance", decision.expected.false_acceptance);
  write_evidence(group, "known_evidence", decision.known);
  write_evidence(group, "unknown_evidence", decision.unknown);
  const Hdf5Group tuning = group.make_group("tuning");
  for_each_constant(decision.tuning, [&](const char* name, double value) { tuning.write(name, value); });
}

DecisionModel read_decision(const Hdf5Group& group) {
  DecisionModel decision;
  read_weights(group, "whole_weights", decision.weights.whole);
  read_weights(group, "windows_weights", decision.weights.windows);
  read_weights(group, "occluded_weights", decision.weights.occluded);
  decision.required = group.read_double("required");
  decision.required_occluded = group.read_double("required_occluded");
  decision.settled = group.read_double("settled");
  decision.held_for_acceptance = group.read_bool("held_for_acceptance");
  decision.set = {group.read_double("set_false_rejection"), group.read_double("set_false_acceptance")};
  decision.expected = {group.read_double("expected_false_rejection"),
                       group.read_double("expected_false_acceptance")};
  decision.known = read_evidence(group, "known_evidence");
  decision.unknown = read_evidence(group, "unknown_evidence");
  const Hdf5Group tuning = group.open_group("tuning");
  for_each_constant(decision.tuning,
                    [&](const char* name, double& value) { value = tuning.read_double(name); });
  return decision;
}

void write_content(const Hdf5Group& root, const Model& model) {
  write_normalization(root.make_group("normalization"), model.normalization);
  write_eigenspace(root.make_group("eigenspace"), model.eigenspace);
  const Hdf5Group objects = root.make_group("objects");
  for (std::size_t i = 0; i < model.objects.size(); ++i)
    write_object(objects.make_group(numbered(i)), model.objects[i]);
  if (model.parts) write_parts(root.make_group("parts"), *model.parts);
  write_decision(root.make_group("decision"), model.decision);
  const Hdf5Group provenance = root.make_group("provenance");
  provenance.write("program_version", model.provenance.program_version);
  provenance.write("created", model.provenance.created);
  provenance.write("image_sets", model.provenance.image_sets);
  provenance.write("solver", model.provenance.solver);
  provenance.write("energy", model.provenance.energy);
  if (model.provenance.energy_bound > 0.0) provenance.write("energy_bound", model.provenance.energy_bound);
}

Model read_content(const std::filesystem::path& path) {
  const Hdf5Lock lock;
  const Hdf5Handle file = open_hdf5(path);
  const Hdf5Group root = root_of(file);
  Model model;
  model.normalization = read_normalization(root.open_group("normalization"));
  model.eigenspace = read_eigenspace(root.open_group("eigenspace"));
  const Hdf5Group objects = root.open_group("objects");
  for (const std::string& name : objects.group_names())
    model.objects.push_back(read_object(objects.open_group(name)));
  if (root.has("parts"))
    model.parts = std::make_shared<const PartsModel>(read_parts(root.open_group("parts"), model.objects));
  model.decision = read_decision(root.open_group("decision"));
  const Hdf5Group provenance = root.open_group("provenance");
  model.provenance.program_version = provenance.read_text("program_version");
  model.provenance.created = provenance.read_text("created");
  model.provenance.image_sets = provenance.read_text("image_sets");
  model.provenance.solver = provenance.read_text("solver");
  model.provenance.energy = provenance.read_double("energy");
  if (provenance.has_attribute("energy_bound"))
    model.provenance.energy_bound = provenance.read_double("energy_bound");
  return model;
}

}  // namespace

void save_model(const Model& model, const std::filesystem::path& file) {
  AtomicFile atomic(file);
  remove_abandoned_parts(atomic.part().parent_path());
  write_hdf5(atomic, seal_size, [&](const Hdf5Group& root) { write_content(root, model); });
  seal_file(model_format, atomic);
  atomic.commit([](const std::filesystem::path& part) { (void)load_model(part); });
}

Model load_model(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error)
    throw FileError(file, "there is no such model; 'eigenpose learn' makes one");
  check_seal(model_format, file);
  const auto refuse = [&](const char* what) {
    return FileError(file, std::string(what) + "; " + std::string(model_format.remedy));
  };
  try {
    Model model = read_content(file);
    check_model(model);
    return model;
  } catch (const Hdf5Failure& failure) {
    throw refuse(failure.what());
  } catch (const std::logic_error& failure) {  // values that fit no container or no workspace
    throw refuse(failure.what());
  } catch (const std::bad_alloc&) {
    throw refuse("needs more memory than there is");
  }
}

}  // namespace eigenpose
