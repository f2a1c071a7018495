#include "core/dataset/image_set_format.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>
#include <string_view>

#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "core/image/picture_file.h"

namespace eigenpose {
namespace {

using nlohmann::json;

constexpr const char* format_name = "eigenpose image set";
constexpr int format_version = 1;

json parse_json(const std::filesystem::path& file, std::string_view text, const std::string& where) {
  json value = json::parse(text, nullptr, false);
  if (value.is_discarded() || !value.is_object())
    throw FileError(file, where + "is not a JSON object; restore the file or import the set again");
  return value;
}

/// The value of `key`, of type T. @throws FileError naming file and key.
template <typename T>
T required(const json& object, const char* key, const std::filesystem::path& file, const std::string& where) {
  const auto found = object.find(key);
  if (found == object.end()) throw FileError(file, where + "has no \"" + key + "\"");
  try {
    return found->get<T>();
  } catch (const json::exception&) {
    throw FileError(file, where + "\"" + key + "\" is " + found->dump() + ", which is of the wrong kind");
  }
}

Workspace parse_workspace(const json& list, const std::filesystem::path& file) {
  std::vector<Dof> dofs;
  for (const json& item : list) {
    if (!item.is_object()) throw FileError(file, "\"workspace\" holds something that is not a JSON object");
    const std::string where = "in \"workspace\": ";
    dofs.push_back(
        {required<std::string>(item, "name", file, where), required<std::string>(item, "unit", file, where),
         required<double>(item, "lower", file, where), required<double>(item, "upper", file, where),
         required<bool>(item, "periodic", file, where)});
  }
  try {
    return Workspace(std::move(dofs));
  } catch (const std::invalid_argument& wrong) {
    throw FileError(file, std::string("\"workspace\": ") + wrong.what());
  }
}

json describe(const Workspace& workspace) {
  json list = json::array();
  for (const Dof& dof : workspace.dofs())
    list.push_back({{"name", dof.name},
                    {"unit", dof.unit},
                    {"lower", dof.lower},
                    {"upper", dof.upper},
                    {"periodic", dof.periodic}});
  return list;
}

/// A file name inside the folder, no way out of it.
bool plain_file_name(const std::string& name) {
  return !name.empty() && name.front() != '.' && name.find('/') == std::string::npos;
}

ViewRecord parse_view(std::string_view text, const Workspace& workspace, const std::filesystem::path& file,
                      const std::string& where) {
  const json line = parse_json(file, text, where);
  ViewRecord view{required<std::string>(line, "file", file, where),
                  required<std::vector<double>>(line, "q", file, where)};
  if (!plain_file_name(view.file))
    throw FileError(file, where + "\"file\" is not the name of a file in this folder");
  if (view.q.size() != workspace.size())
    throw FileError(file, where + "\"q\" has " + std::to_string(view.q.size()) +
                              " values, the workspace has " + std::to_string(workspace.size()));
  if (!std::all_of(view.q.begin(), view.q.end(), [](double v) { return std::isfinite(v); }))
    throw FileError(file, where + "\"q\" is not finite");
  view.q = workspace.canonical(view.q);
  return view;
}

}  // namespace

SetJournal read_set_journal(const std::filesystem::path& folder, const Workspace& workspace, bool complete) {
  const auto file = folder / "views.jsonl";
  SetJournal journal;
  if (!std::filesystem::exists(file)) {
    if (complete) throw FileError(file, "is missing; the image set cannot be used without it");
    return journal;
  }
  const auto bytes = read_file(file);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::set<std::string> seen;
  std::size_t number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = text.find('\n', at);
    const std::string where = "line " + std::to_string(++number) + " ";
    if (end == std::string_view::npos) {
      if (complete) throw FileError(file, where + "is cut off; restore the file or acquire the set again");
      break;  // what a crash in the middle of `add` leaves
    }
    ViewRecord view = parse_view(text.substr(at, end - at), workspace, file, where);
    if (!seen.insert(view.file).second)
      throw FileError(file, where + "names \"" + view.file + "\" a second time");
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
  if (!std::filesystem::exists(file))
    throw FileError(
        folder,
        "is not an image set: it has no set.json; 'eigenpose import' and 'eigenpose acquire' make them");
  const auto bytes = read_file(file);
  const json all = parse_json(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()}, "");
  if (required<std::string>(all, "format", file, "") != format_name)
    throw FileError(file, std::string("is not of the format \"") + format_name + "\"");
  if (const int version = required<int>(all, "version", file, ""); version != format_version)
    throw FileError(file, "has version " + std::to_string(version) + ", this program reads version " +
                              std::to_string(format_version) + "; import or acquire the set again");
  SetIndex index{required<std::string>(all, "object", file, ""),
                 parse_workspace(required<json>(all, "workspace", file, ""), file),
                 required<bool>(all, "cropped", file, ""), required<bool>(all, "complete", file, "")};
  return index;
}

std::string set_index_text(const SetIndex& index, const nlohmann::json& source) {
  const json all = {{"format", format_name},    {"version", format_version},
                    {"object", index.object},   {"workspace", describe(index.workspace)},
                    {"cropped", index.cropped}, {"complete", index.complete},
                    {"source", source}};
  return all.dump(2) + "\n";
}

}  // namespace eigenpose
