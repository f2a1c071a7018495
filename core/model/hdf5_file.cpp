#include "core/model/hdf5_file.h"

#include <array>
#include <cstdio>
#include <utility>

namespace eigenpose {
namespace {

std::mutex& library_mutex() {
  static std::mutex mutex;
  return mutex;
}

/// A handle could not be closed. Guarded by the library's mutex.
bool& close_failure() {
  static bool failed = false;
  return failed;
}

void check(herr_t status, const std::string& what) {
  if (status < 0) throw Hdf5Failure(what);
}

void write_attribute(hid_t group, const std::string& name, hid_t file_type, hid_t memory_type,
                     const void* value) {
  const std::string what = "cannot write attribute \"" + name + "\"";
  const Hdf5Handle space(H5Screate(H5S_SCALAR), H5Sclose, what);
  const Hdf5Handle attribute(
      H5Acreate2(group, name.c_str(), file_type, space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose, what);
  check(H5Awrite(attribute.get(), memory_type, value), what);
}

void read_attribute(hid_t group, const std::string& name, hid_t memory_type, void* value) {
  const std::string what = "has no attribute \"" + name + "\" of the right kind";
  const Hdf5Handle attribute(H5Aopen(group, name.c_str(), H5P_DEFAULT), H5Aclose, what);
  const Hdf5Handle space(H5Aget_space(attribute.get()), H5Sclose, what);
  if (H5Sget_simple_extent_npoints(space.get()) != 1) throw Hdf5Failure(what);
  check(H5Aread(attribute.get(), memory_type, value), what);
}

/// A dataset without the time of its making: what is equal is written as equal bytes.
Hdf5Handle make_dataset(hid_t group, const std::string& name, hid_t file_type, hid_t space,
                        const std::string& what) {
  const Hdf5Handle creation(H5Pcreate(H5P_DATASET_CREATE), H5Pclose, what);
  check(H5Pset_obj_track_times(creation.get(), false), what);
  return {H5Dcreate2(group, name.c_str(), file_type, space, H5P_DEFAULT, creation.get(), H5P_DEFAULT),
          H5Dclose, what};
}

void write_list(hid_t group, const std::string& name, hid_t file_type, hid_t memory_type, hsize_t size,
                const void* values) {
  const std::string what = "cannot write \"" + name + "\"";
  const Hdf5Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose, what);
  const Hdf5Handle data = make_dataset(group, name, file_type, space.get(), what);
  check(H5Dwrite(data.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values), what);
}

constexpr std::size_t longest_text = std::size_t{1} << 20;

/// What a dataset claims is in this file, so that nothing is allocated for values that are not there.
void check_storage(hid_t dataset, hid_t space, const std::string& what) {
  const Hdf5Handle creation(H5Dget_create_plist(dataset), H5Pclose, what);
  const Hdf5Handle type(H5Dget_type(dataset), H5Tclose, what);
  const Hdf5Handle file(H5Iget_file_id(dataset), H5Fclose, what);
  hsize_t file_size = 0;
  check(H5Fget_filesize(file.get(), &file_size), what);
  const H5D_layout_t layout = H5Pget_layout(creation.get());
  const hssize_t values = H5Sget_simple_extent_npoints(space);
  const std::size_t value_size = H5Tget_size(type.get());
  if ((layout != H5D_CONTIGUOUS && layout != H5D_COMPACT) || H5Pget_external_count(creation.get()) != 0 ||
      values < 0 || value_size == 0 || static_cast<hsize_t>(values) > file_size / value_size)
    throw Hdf5Failure(what);
}

/// A dataset of one dimension, and its length.
struct OpenList {
  OpenList(hid_t group, const std::string& name, const std::string& what)
      : data(H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose, what) {
    const Hdf5Handle space(H5Dget_space(data.get()), H5Sclose, what);
    if (H5Sget_simple_extent_ndims(space.get()) != 1) throw Hdf5Failure(what);
    check(H5Sget_simple_extent_dims(space.get(), &size, nullptr), what);
    check_storage(data.get(), space.get(), what);
  }
  Hdf5Handle data;
  hsize_t size = 0;
};

template <typename Matrix>
void write_dataset(hid_t group, const std::string& name, hid_t file_type, hid_t memory_type,
                   const Matrix& matrix) {
  const std::string what = "cannot write dataset \"" + name + "\"";
  const std::array<hsize_t, 2> shape{static_cast<hsize_t>(matrix.cols()),
                                     static_cast<hsize_t>(matrix.rows())};
  const Hdf5Handle space(H5Screate_simple(2, shape.data(), nullptr), H5Sclose, what);
  const Hdf5Handle dataset = make_dataset(group, name, file_type, space.get(), what);
  check(H5Dwrite(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, matrix.data()), what);
}

template <typename Matrix>
Matrix read_dataset(hid_t group, const std::string& name, hid_t memory_type) {
  const std::string what = "has no dataset \"" + name + "\" of the right kind";
  const Hdf5Handle dataset(H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose, what);
  const Hdf5Handle space(H5Dget_space(dataset.get()), H5Sclose, what);
  std::array<hsize_t, 2> shape{};
  if (H5Sget_simple_extent_ndims(space.get()) != 2) throw Hdf5Failure(what);
  check(H5Sget_simple_extent_dims(space.get(), shape.data(), nullptr), what);
  check_storage(dataset.get(), space.get(), what);
  Matrix matrix(static_cast<Eigen::Index>(shape[1]), static_cast<Eigen::Index>(shape[0]));
  check(H5Dread(dataset.get(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, matrix.data()), what);
  return matrix;
}

}  // namespace

std::string numbered(std::size_t i) {
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "%06zu", i);
  return text.data();
}

Hdf5Lock::Hdf5Lock() : lock_(library_mutex()) {
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}

Hdf5Handle::Hdf5Handle(hid_t id, Close close, const std::string& what) : id_(id), close_(close) {
  if (id < 0) throw Hdf5Failure(what);
}

Hdf5Handle::Hdf5Handle(Hdf5Handle&& other) noexcept
    : id_(std::exchange(other.id_, -1)), close_(other.close_) {}

Hdf5Handle::~Hdf5Handle() {
  if (id_ >= 0 && close_(id_) < 0) close_failure() = true;
}

bool take_close_failure() {
  return std::exchange(close_failure(), false);
}

Hdf5Group Hdf5Group::make_group(const std::string& name) const {
  return Hdf5Group(Hdf5Handle(H5Gcreate2(handle_.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
                              H5Gclose, "cannot make group \"" + name + "\""));
}

Hdf5Group Hdf5Group::open_group(const std::string& name) const {
  return Hdf5Group(Hdf5Handle(H5Gopen2(handle_.get(), name.c_str(), H5P_DEFAULT), H5Gclose,
                              "has no group \"" + name + "\""));
}

std::vector<std::string> Hdf5Group::group_names() const {
  H5G_info_t info{};
  check(H5Gget_info(handle_.get(), &info), "has a group that cannot be listed");
  std::vector<std::string> names;
  for (hsize_t i = 0; i < info.nlinks; ++i) {
    std::array<char, 256> name{};
    if (H5Lget_name_by_idx(handle_.get(), ".", H5_INDEX_NAME, H5_ITER_INC, i, name.data(), name.size(),
                           H5P_DEFAULT) < 0)
      throw Hdf5Failure("has a group that cannot be listed");
    names.emplace_back(name.data());
  }
  return names;
}

void Hdf5Group::write(const std::string& attribute, double value) const {
  write_attribute(handle_.get(), attribute, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &value);
}

void Hdf5Group::write(const std::string& attribute, std::int64_t value) const {
  write_attribute(handle_.get(), attribute, H5T_STD_I64LE, H5T_NATIVE_INT64, &value);
}

void Hdf5Group::write(const std::string& attribute, const std::string& value) const {
  const Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose, "cannot make a text type");
  // HDF5 refuses texts of no length: the end mark is stored too.
  check(H5Tset_size(type.get(), value.size() + 1), "cannot make a text type");
  check(H5Tset_cset(type.get(), H5T_CSET_UTF8), "cannot make a text type");
  write_attribute(handle_.get(), attribute, type.get(), type.get(), value.c_str());
}

double Hdf5Group::read_double(const std::string& attribute) const {
  double value = 0.0;
  read_attribute(handle_.get(), attribute, H5T_NATIVE_DOUBLE, &value);
  return value;
}

std::int64_t Hdf5Group::read_integer(const std::string& attribute, std::int64_t lower,
                                     std::int64_t upper) const {
  std::int64_t value = 0;
  read_attribute(handle_.get(), attribute, H5T_NATIVE_INT64, &value);
  if (value < lower || value > upper)
    throw Hdf5Failure("has \"" + attribute + "\" of " + std::to_string(value) + "; allowed are " +
                      std::to_string(lower) + " to " + std::to_string(upper));
  return value;
}

std::string Hdf5Group::read_text(const std::string& attribute) const {
  const std::string what = "has no text \"" + attribute + "\"";
  const Hdf5Handle open(H5Aopen(handle_.get(), attribute.c_str(), H5P_DEFAULT), H5Aclose, what);
  const Hdf5Handle type(H5Aget_type(open.get()), H5Tclose, what);
  if (H5Tget_class(type.get()) != H5T_STRING || H5Tis_variable_str(type.get()) > 0) throw Hdf5Failure(what);
  const std::size_t size = H5Tget_size(type.get());
  if (size > longest_text) throw Hdf5Failure(what);
  std::vector<char> text(size + 1, '\0');
  check(H5Aread(open.get(), type.get(), text.data()), what);
  return text.data();
}

void Hdf5Group::write(const std::string& dataset, const Eigen::MatrixXf& matrix) const {
  write_dataset(handle_.get(), dataset, H5T_IEEE_F32LE, H5T_NATIVE_FLOAT, matrix);
}

void Hdf5Group::write(const std::string& dataset, const Eigen::MatrixXd& matrix) const {
  write_dataset(handle_.get(), dataset, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, matrix);
}

void Hdf5Group::write(const std::string& dataset, const std::vector<std::int8_t>& bytes) const {
  write_list(handle_.get(), dataset, H5T_STD_I8LE, H5T_NATIVE_INT8, bytes.size(), bytes.data());
}

void Hdf5Group::write(const std::string& dataset, std::span<const std::uint8_t> bytes) const {
  write_list(handle_.get(), dataset, H5T_STD_U8LE, H5T_NATIVE_UINT8, bytes.size(), bytes.data());
}

std::vector<std::int8_t> Hdf5Group::read_bytes(const std::string& dataset) const {
  const std::string what = "has no bytes \"" + dataset + "\"";
  const OpenList list(handle_.get(), dataset, what);
  std::vector<std::int8_t> bytes(list.size);
  check(H5Dread(list.data.get(), H5T_NATIVE_INT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), what);
  return bytes;
}

void Hdf5Group::read_bytes(const std::string& dataset, std::span<std::uint8_t> bytes) const {
  const std::string what = "has no " + std::to_string(bytes.size()) + " bytes \"" + dataset + "\"";
  const OpenList list(handle_.get(), dataset, what);
  if (list.size != bytes.size()) throw Hdf5Failure(what);
  check(H5Dread(list.data.get(), H5T_NATIVE_UINT8, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), what);
}

bool Hdf5Group::has(const std::string& name) const {
  return H5Lexists(handle_.get(), name.c_str(), H5P_DEFAULT) > 0;
}

bool Hdf5Group::has_attribute(const std::string& name) const {
  return H5Aexists(handle_.get(), name.c_str()) > 0;
}

Eigen::MatrixXf Hdf5Group::read_floats(const std::string& dataset) const {
  return read_dataset<Eigen::MatrixXf>(handle_.get(), dataset, H5T_NATIVE_FLOAT);
}

Eigen::MatrixXd Hdf5Group::read_doubles(const std::string& dataset) const {
  return read_dataset<Eigen::MatrixXd>(handle_.get(), dataset, H5T_NATIVE_DOUBLE);
}

Hdf5Handle open_hdf5(const std::filesystem::path& path) {
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "cannot be opened");
  check(H5Pset_file_locking(access.get(), false, true), "cannot be opened");
  return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.get()), H5Fclose, "is not an HDF5 file"};
}

Hdf5Group root_of(const Hdf5Handle& file) {
  return Hdf5Group(Hdf5Handle(H5Gopen2(file.get(), "/", H5P_DEFAULT), H5Gclose, "has no root group"));
}

}  // namespace eigenpose
