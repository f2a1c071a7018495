#pragma once

/// The two text files of an image set, shared by its reader and its writer.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "core/base/workspace.h"
#include "core/dataset/image_set.h"

namespace eigenpose {

/// What set.json says, its source apart.
struct SetIndex {
  std::string object;
  Workspace workspace;
  bool cropped = false;
  bool complete = false;
};

/// What views.jsonl says.
struct SetJournal {
  std::vector<ViewRecord> views;
  std::uintmax_t good_bytes = 0;  ///< up to the end of the last whole line
};

/// @throws FileError when set.json is missing or malformed.
SetIndex read_set_index(const std::filesystem::path& folder);
/// The source in set.json. @throws FileError when set.json is malformed or has none.
nlohmann::json read_set_source(const std::filesystem::path& folder);

/// What a journal is read for.
enum class SetState {
  unfinished,  ///< views may be missing, and the last line may be cut off
  complete     ///< every view has its line
};
/// @throws FileError when views.jsonl is malformed; and for a complete set when it is missing, empty or cut
/// off.
SetJournal read_set_journal(const std::filesystem::path& folder, const Workspace& workspace, SetState state);
/// One line of a journal (indent −1) or the text of a file. Texts that are not UTF-8, such as old file names,
/// get the replacement character U+FFFD where they are not.
std::string json_line(const nlohmann::json& value, int indent = -1);
/// The text of set.json.
std::string set_index_text(const SetIndex& index, const nlohmann::json& source);

}  // namespace eigenpose
