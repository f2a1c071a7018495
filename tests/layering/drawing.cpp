#include "tests/layering/drawing.h"

#include <algorithm>
#include <functional>
#include <set>
#include <sstream>
#include <stdexcept>
#include <vector>

namespace eigenpose::layering {
namespace {

using Rooms = std::vector<std::string>;

/// Room → rooms it includes.
std::map<std::string, Rooms> below(const Edges& edges) {
  std::map<std::string, Rooms> result;
  for (const auto& [edge, count] : edges) {
    result[edge.first].push_back(edge.second);
    result[edge.second];
  }
  return result;
}

/// Whether `to` is reached from `from` by more than one edge.
bool implied(const std::map<std::string, Rooms>& rooms, const std::string& from, const std::string& to) {
  std::set<std::string> seen;
  std::vector<std::string> open;
  for (const std::string& next : rooms.at(from))
    if (next != to) open.push_back(next);
  while (!open.empty()) {
    const std::string room = open.back();
    open.pop_back();
    if (room == to) return true;
    if (!seen.insert(room).second) continue;
    open.insert(open.end(), rooms.at(room).begin(), rooms.at(room).end());
  }
  return false;
}

std::vector<Rooms> by_floor(const Edges& edges) {
  std::vector<Rooms> result;
  for (const auto& [room, floor] : floors(edges)) {
    if (result.size() <= static_cast<std::size_t>(floor)) result.resize(static_cast<std::size_t>(floor) + 1);
    result[static_cast<std::size_t>(floor)].push_back(room);
  }
  return result;
}

const char* color(const std::string& room) {
  if (room.starts_with("core")) return "#dbeafe";
  if (room.starts_with("drivers")) return "#dcfce7";
  if (room.starts_with("daemon")) return "#fef3c7";
  return "#f3e8ff";
}

constexpr int box_width = 176;
constexpr int box_height = 34;
constexpr int column = 200;
constexpr int row = 84;
constexpr int margin = 24;

struct Place {
  int x = 0;
  int y = 0;
};

std::map<std::string, Place> places(const std::vector<Rooms>& rows, int width) {
  std::map<std::string, Place> result;
  const int height = static_cast<int>(rows.size()) * row;
  for (std::size_t floor = 0; floor < rows.size(); ++floor) {
    const int taken = static_cast<int>(rows[floor].size()) * column;
    for (std::size_t i = 0; i < rows[floor].size(); ++i)
      result[rows[floor][i]] = {margin + (width - taken) / 2 + static_cast<int>(i) * column,
                                margin + height - row * (static_cast<int>(floor) + 1)};
  }
  return result;
}

}  // namespace

std::map<std::string, int> floors(const Edges& edges) {
  const auto rooms = below(edges);
  std::map<std::string, int> result;
  std::set<std::string> entered;
  const std::function<int(const std::string&)> floor_of = [&](const std::string& room) {
    if (const auto known = result.find(room); known != result.end()) return known->second;
    if (!entered.insert(room).second) throw std::logic_error(room + " includes itself through other rooms");
    int floor = 0;
    for (const std::string& next : rooms.at(room)) floor = std::max(floor, floor_of(next) + 1);
    return result[room] = floor;
  };
  for (const auto& [room, unused] : rooms) floor_of(room);
  return result;
}

std::string draw(const Edges& edges) {
  const std::vector<Rooms> rows = by_floor(edges);
  std::size_t widest = 1;
  for (const Rooms& one : rows) widest = std::max(widest, one.size());
  const int width = static_cast<int>(widest) * column;
  const auto place = places(rows, width);
  const auto rooms = below(edges);
  std::ostringstream out;
  out << "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"" << width + 2 * margin << "\" height=\""
      << static_cast<int>(rows.size()) * row + 2 * margin
      << "\" font-family=\"sans-serif\" font-size=\"14\">\n"
      << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n<g fill=\"none\" stroke=\"#64748b\">\n";
  for (const auto& [edge, count] : edges) {
    if (implied(rooms, edge.first, edge.second)) continue;
    const Place from = place.at(edge.first);
    const Place to = place.at(edge.second);
    const int x0 = from.x + box_width / 2;
    const int x1 = to.x + box_width / 2;
    const int y0 = from.y + box_height;
    out << "<path d=\"M" << x0 << ' ' << y0 << " C" << x0 << ' ' << (y0 + to.y) / 2 << ' ' << x1 << ' '
        << (y0 + to.y) / 2 << ' ' << x1 << ' ' << to.y << "\"><title>" << edge.first << " includes "
        << edge.second << " " << count << " times</title></path>\n";
  }
  out << "</g>\n<g text-anchor=\"middle\" fill=\"#0f172a\">\n";
  for (const auto& [room, at] : place)
    out << "<rect x=\"" << at.x << "\" y=\"" << at.y << "\" width=\"" << box_width << "\" height=\""
        << box_height << "\" rx=\"6\" stroke=\"#334155\" fill=\"" << color(room) << "\"/><text x=\""
        << at.x + box_width / 2 << "\" y=\"" << at.y + 22 << "\">" << room << "</text>\n";
  out << "</g>\n</svg>\n";
  return out.str();
}

std::string describe(const Edges& edges) {
  std::ostringstream out;
  const std::vector<Rooms> rows = by_floor(edges);
  for (std::size_t floor = rows.size(); floor-- > 0;)
    for (const std::string& room : rows[floor]) {
      out << floor << "  " << room << ":";
      for (const auto& [edge, count] : edges)
        if (edge.first == room) out << ' ' << edge.second << '(' << count << ')';
      out << '\n';
    }
  return out.str();
}

}  // namespace eigenpose::layering
