#include "core/model/hdf5_output.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <iterator>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/error.h"

namespace eigenpose {
namespace {

/// Where the library's bytes go, and what became of them.
struct Sink {
  AtomicFile* file = nullptr;  ///< null: the bytes are dropped
  std::exception_ptr failure;  ///< the first one; after it nothing is written any more
  /// Metadata that came after the failure, by address. The library may read it again before it closes the
  /// file.
  std::map<haddr_t, std::vector<char>> kept;

  void write(H5FD_mem_t type, haddr_t at, std::string_view bytes) {
    if (file == nullptr) return;
    if (!failure) {
      try {
        file->write_at(at, bytes);
        return;
      } catch (...) {
        failure = std::current_exception();
      }
    }
    if (type != H5FD_MEM_DRAW) kept[at].assign(bytes.begin(), bytes.end());
  }

  void read(haddr_t at, std::span<std::uint8_t> bytes) {
    std::fill(bytes.begin(), bytes.end(), std::uint8_t{0});
    if (file == nullptr) return;
    try {
      (void)file->read_at(at, bytes);
    } catch (...) {
      if (!failure) failure = std::current_exception();
    }
    for (const auto& [address, piece] : kept) {
      const haddr_t first = std::max(at, address);
      const haddr_t last = std::min(at + bytes.size(), address + piece.size());
      if (first < last)
        std::memcpy(bytes.data() + (first - at), piece.data() + (first - address), last - first);
    }
  }
};

/// What the library holds of an open file. Its own part comes first.
struct DriverFile {
  H5FD_t own{};
  Sink* sink = nullptr;
  haddr_t end_of_addresses = 0;
  haddr_t end_of_file = 0;
};

struct DriverInfo {
  Sink* sink = nullptr;
};

DriverFile& mine(H5FD_t* file) {
  return *reinterpret_cast<DriverFile*>(file);
}
const DriverFile& mine(const H5FD_t* file) {
  return *reinterpret_cast<const DriverFile*>(file);
}

constexpr haddr_t largest_address = (haddr_t{1} << 62) - 1;

H5FD_t* driver_open(const char* /*name*/, unsigned /*flags*/, hid_t access, haddr_t /*largest*/) {
  const auto* info = static_cast<const DriverInfo*>(H5Pget_driver_info(access));
  if (info == nullptr) return nullptr;
  auto file = std::make_unique<DriverFile>();
  file->sink = info->sink;
  return &file.release()->own;
}

herr_t driver_close(H5FD_t* file) {
  delete &mine(file);
  return 0;
}

herr_t driver_query(const H5FD_t* /*file*/, unsigned long* flags) {
  // Not ACCUMULATE_METADATA: pieces of metadata are kept one by one after a failure.
  *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t driver_end_of_addresses(const H5FD_t* file, H5FD_mem_t /*type*/) {
  return mine(file).end_of_addresses;
}
herr_t driver_set_end_of_addresses(H5FD_t* file, H5FD_mem_t /*type*/, haddr_t address) {
  mine(file).end_of_addresses = address;
  return 0;
}
haddr_t driver_end_of_file(const H5FD_t* file, H5FD_mem_t /*type*/) {
  return mine(file).end_of_file;
}

/// Calls `work`; no exception passes through the library. Only memory can be short here.
template <typename Work>
herr_t guarded(const Work& work) noexcept {
  try {
    work();
    return 0;
  } catch (...) {
    return -1;
  }
}

herr_t driver_read(H5FD_t* file, H5FD_mem_t /*type*/, hid_t /*transfer*/, haddr_t at, std::size_t size,
                   void* buffer) {
  return guarded([&] { mine(file).sink->read(at, {static_cast<std::uint8_t*>(buffer), size}); });
}

herr_t driver_write(H5FD_t* file, H5FD_mem_t type, hid_t /*transfer*/, haddr_t at, std::size_t size,
                    const void* buffer) {
  DriverFile& driver = mine(file);
  driver.end_of_file = std::max(driver.end_of_file, at + size);
  return guarded([&] { driver.sink->write(type, at, {static_cast<const char*>(buffer), size}); });
}

herr_t driver_truncate(H5FD_t* file, hid_t /*transfer*/, hbool_t /*closing*/) {
  DriverFile& driver = mine(file);
  driver.end_of_file = driver.end_of_addresses;
  Sink& sink = *driver.sink;
  if (sink.file == nullptr || sink.failure) return 0;
  try {
    sink.file->resize(driver.end_of_addresses);
  } catch (...) {
    sink.failure = std::current_exception();
  }
  return 0;
}

H5FD_class_t make_driver() {
  H5FD_class_t driver{};
  driver.name = "eigenpose";
  driver.maxaddr = largest_address;
  driver.fc_degree = H5F_CLOSE_STRONG;
  driver.fapl_size = sizeof(DriverInfo);
  driver.open = driver_open;
  driver.close = driver_close;
  driver.query = driver_query;
  driver.get_eoa = driver_end_of_addresses;
  driver.set_eoa = driver_set_end_of_addresses;
  driver.get_eof = driver_end_of_file;
  driver.read = driver_read;
  driver.write = driver_write;
  driver.truncate = driver_truncate;
  constexpr H5FD_mem_t lists[H5FD_MEM_NTYPES] = H5FD_FLMAP_DICHOTOMY;
  std::copy(std::begin(lists), std::end(lists), std::begin(driver.fl_map));
  return driver;
}

/// The driver's number in the library. Under the Hdf5Lock.
hid_t driver_number() {
  static const H5FD_class_t driver = make_driver();
  static const hid_t number = H5FDregister(&driver);
  return number;
}

/// An HDF5 file without content. The sink outlives it.
Hdf5Handle begin_file(const std::string& name, std::uint64_t user_block, Sink& sink) {
  const std::string what = "cannot begin an HDF5 file";
  const Hdf5Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose, what);
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, what);
  const DriverInfo info{&sink};
  if (H5Pset_userblock(creation.get(), user_block) < 0 || driver_number() < 0 ||
      H5Pset_driver(access.get(), driver_number(), &info) < 0)
    throw Hdf5Failure(what);
  return {H5Fcreate(name.c_str(), H5F_ACC_TRUNC, creation.get(), access.get()), H5Fclose, what};
}

}  // namespace

void write_hdf5(AtomicFile& file, std::uint64_t user_block,
                const std::function<void(const Hdf5Group& root)>& content) {
  const Hdf5Lock lock;
  auto sink = std::make_unique<Sink>();
  sink->file = &file;
  (void)take_close_failure();
  std::string trouble;
  try {
    const Hdf5Handle handle = begin_file(file.part().string(), user_block, *sink);
    content(root_of(handle));
  } catch (const Hdf5Failure& failure) {
    trouble = failure.what();
  }
  const std::exception_ptr failure = sink->failure;
  if (take_close_failure()) {
    // The library may still hold the file, until the program ends: what it writes then is dropped.
    sink->file = nullptr;
    (void)sink.release();
    if (trouble.empty()) trouble = "cannot be completed by the HDF5 library; is memory short?";
  }
  if (failure) std::rethrow_exception(failure);
  if (!trouble.empty()) throw FileError(file.target(), trouble);
}

}  // namespace eigenpose
