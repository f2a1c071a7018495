#pragma once

/// What of a data set could not be used.

#include <filesystem>
#include <string>

namespace eigenpose {

/// What is done about a view that cannot be used.
enum class BadViews {
  leave_out,  ///< it is named in the report; an object without enough others is left out whole
  refuse,     ///< nothing more is imported or learned
};

/// One view, or all views of one object, that import or learning went on without.
struct LeftOut {
  std::string object;
  std::filesystem::path
      file;  ///< the view's picture; the set's folder, or empty, where the whole object is left out
  bool whole_object = false;
  std::string reason;  ///< what is wrong with it, and what to do

  /// "obj3: SETS/obj3/000017.png: shows nothing that stands out …".
  [[nodiscard]] std::string text() const {
    return object + ": " + (file.empty() ? "" : file.string() + ": ") + reason;
  }
};

}  // namespace eigenpose
