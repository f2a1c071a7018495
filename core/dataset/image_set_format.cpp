#include "core/dataset/image_set_format.h"

#include <set>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/base/input_file.h"
#include "core/base/json.h"
#include "core/base/object_name.h"
#include "core/dataset/workspace_json.h"

namespace eigenpose {
namespace {

using nlohmann::json;

constexpr const char* format_name = "eigenpose image set";
constexpr int format_version = 1;

/// Calls `read`; what it finds wrong is wrong in `file`, at `where`.
template <typename Read>
auto in_file(const std::filesystem::path& file, const std::string& where, const Read& read) {
  try {
    return read();
  } catch (const JsonError& wrong) {
    throw FileError(file, where + wrong.what() + "; restore the file, or acquire or import the set again");
  } catch (const std::invalid_argument& wrong) {
    throw FileError(file, where + wrong.what() + "; restore the file, or acquire or import the set again");
  }
}

/// @throws JsonError, std::invalid_argument.
Workspace parse_workspace(const json& list) {
  if (!list.is_array()) throw JsonError("\"workspace\" is not an array");
  std::vector<Dof> dofs;
  for (const json& item : list)
    dofs.push_back(
        {json_text(json_member(item, "name"), "name"), json_text(json_member(item, "unit"), "unit"),
         json_number(json_member(item, "lower"), "lower"), json_number(json_member(item, "upper"), "upper"),
         json_flag(json_member(item, "periodic"), "periodic")});
  return Workspace(std::move(dofs));
}

/// A file name inside the folder, no way out of it.
bool plain_file_name(const std::string& name) {
  return !name.empty() && name.front() != '.' &&
         name.find_first_of(std::string_view("/\0", 2)) == std::string::npos;
}

/// @throws JsonError.
ViewRecord parse_view(std::string_view text, const Workspace& workspace) {
  const json line = parse_json(text);
  ViewRecord view{json_text(json_member(line, "file"), "file"), json_numbers(json_member(line, "q"), "q")};
  if (!plain_file_name(view.file)) throw JsonError("\"file\" is not the name of a file in this folder");
  if (view.q.size() != workspace.size())
    throw JsonError("\"q\" has " + std::to_string(view.q.size()) + " values, the workspace has " +
                    std::to_string(workspace.size()));
  view.q = workspace.canonical(view.q);
  return view;
}

}  // namespace

SetJournal read_set_journal(const std::filesystem::path& folder, const Workspace& workspace, SetState state) {
  const bool complete = state == SetState::complete;
  const auto file = folder / "views.jsonl";
  SetJournal journal;
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error) {
    if (complete) throw FileError(file, "is missing; the image set cannot be used without it");
    return journal;
  }
  const auto bytes = read_file(file);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::set<std::string> seen;
  std::size_t number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    const std::string where = "line " + std::to_string(++number) + ": ";
    if (end == std::string_view::npos) {
      if (complete) throw FileError(file, where + "it is cut off; restore the file or acquire the set again");
      break;  // what a crash in the middle of `add` leaves
    }
    ViewRecord view = in_file(file, where, [&] { return parse_view(text.substr(at, end - at), workspace); });
    if (!seen.insert(view.file).second)
      throw FileError(file, where + "it names \"" + view.file + "\" a second time");
    journal.views.push_back(std::move(view));
    at = end + 1;
    journal.good_bytes = at;
  }
  if (complete && journal.views.empty())
    throw FileError(file, "holds no view; acquire or import the set again");
  return journal;
}

SetIndex read_set_index(const std::filesystem::path& folder) {
  const auto file = folder / "set.json";
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error)
    throw FileError(
        folder,
        "is not an image set: it has no set.json; 'eigenpose import' and 'eigenpose acquire' make them");
  const auto bytes = read_file(file);
  return in_file(file, "", [&] {
    const json all = parse_json({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    if (json_text(json_member(all, "format"), "format") != format_name)
      throw JsonError(std::string("it is not of the format \"") + format_name + "\"");
    const auto version = json_integer(json_member(all, "version"), "version", 0, 1'000'000);
    if (version != format_version)
      throw JsonError("it has version " + std::to_string(version) + ", this program reads version " +
                      std::to_string(format_version));
    SetIndex index{json_text(json_member(all, "object"), "object"),
                   parse_workspace(json_member(all, "workspace")),
                   json_flag(json_member(all, "cropped"), "cropped"),
                   json_flag(json_member(all, "complete"), "complete")};
    check_object_name(index.object);
    return index;
  });
}

json read_set_source(const std::filesystem::path& folder) {
  const auto file = folder / "set.json";
  const auto bytes = read_file(file);
  return in_file(file, "", [&] {
    return json_member(parse_json({reinterpret_cast<const char*>(bytes.data()), bytes.size()}), "source");
  });
}

std::string json_line(const nlohmann::json& value, int indent) {
  return value.dump(indent, ' ', false, json::error_handler_t::replace) + "\n";
}

std::string set_index_text(const SetIndex& index, const nlohmann::json& source) {
  const json all = {{"format", format_name},    {"version", format_version},
                    {"object", index.object},   {"workspace", workspace_json(index.workspace)},
                    {"cropped", index.cropped}, {"complete", index.complete},
                    {"source", source}};
  return json_line(all, 2);
}

}  // namespace eigenpose
