#include "daemon/manual/man_page.h"

#include <algorithm>
#include <cctype>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

namespace eigenpose {
namespace {

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

/// Text of one line with roff's special characters escaped.
std::string escaped(const std::string& line) {
  std::string result;
  if (!line.empty() && (line[0] == '.' || line[0] == '\'')) result = "\\&";
  for (const char c : line) {
    if (c == '\\')
      result += "\\e";
    else if (c == '-')
      result += "\\-";
    else if (c == '\'')
      result += "\\(aq";
    else
      result += c;
  }
  return result;
}

void paragraph(std::ostream& out, const std::string& text) {
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) out << escaped(line) << '\n';
}

/// Text whose line breaks and indentation count: examples and tables.
void verbatim(std::ostream& out, const std::string& text) {
  const std::size_t first = text.find_first_not_of('\n');
  if (first == std::string::npos) return;
  out << ".PP\n.nf\n";
  paragraph(out, text.substr(first));
  out << ".fi\n";
}

void option(std::ostream& out, const CLI::Option& option) {
  const std::string type = option.get_type_name();
  out << ".TP\n\\fB" << escaped(option.get_name(option.get_positional(), true)) << "\\fR";
  if (option.get_items_expected_max() > 0 && !type.empty()) out << " \\fI" << escaped(type) << "\\fR";
  out << '\n';
  std::string description = option.get_description();
  if (!option.get_default_str().empty()) description += " (default: " + option.get_default_str() + ")";
  paragraph(out, description.empty() ? "(no description)" : description);
}

void options(std::ostream& out, const CLI::App& app) {
  for (const CLI::Option* one : app.get_options())
    if (!one->get_group().empty()) option(out, *one);
}

void command(std::ostream& out, const std::string& parent, const CLI::App& app) {
  const std::string name = parent + " " + app.get_name();
  out << ".SS " << escaped(name) << '\n';
  paragraph(out, app.get_description());
  options(out, app);
  verbatim(out, app.get_footer());
  for (const CLI::App* below : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!below->get_group().empty()) command(out, name, *below);
}

/// The description's first sentence, without its full stop.
std::string summary(const CLI::App& app) {
  const std::string text = app.get_description();
  return text.substr(0, text.find_first_of(".\n"));
}

}  // namespace

std::string man_page(const CLI::App& app, int section, const std::string& see_also) {
  const auto commands = app.get_subcommands([](const CLI::App* one) { return !one->get_group().empty(); });
  std::ostringstream out;
  out << ".TH " << upper(app.get_name()) << ' ' << section << " \"\" \"Eigenpose " << EIGENPOSE_VERSION
      << "\"\n.SH NAME\n"
      << escaped(app.get_name()) << " \\- " << escaped(summary(app)) << "\n.SH SYNOPSIS\n\\fB"
      << escaped(app.get_name()) << "\\fR";
  if (!commands.empty()) out << " \\fICOMMAND\\fR";
  out << " [\\fIOPTIONS\\fR]\n.SH DESCRIPTION\n";
  paragraph(out, app.get_description());
  out << ".SH OPTIONS\n";
  options(out, app);
  if (!commands.empty()) out << ".SH COMMANDS\n";
  for (const CLI::App* one : commands) command(out, app.get_name(), *one);
  if (!app.get_footer().empty()) {
    out << ".SH NOTES\n";
    verbatim(out, app.get_footer());
  }
  if (!see_also.empty()) out << ".SH SEE ALSO\n" << escaped(see_also) << '\n';
  return out.str();
}

void add_man_flag(CLI::App& app, int section, const std::string& see_also) {
  app.add_flag_callback("--man",
                        [&app, section, see_also] {
                          std::cout << man_page(app, section, see_also);
                          throw CLI::Success();
                        })
      ->group("");
}

}  // namespace eigenpose
