#pragma once

/// A manual page made from the same declaration as `--help`, so that the two cannot differ.

#include <string>

namespace CLI {
class App;
}

namespace eigenpose {

/// The manual page of a program in roff, for section `section` of the manual: description, options, every
/// subcommand with its own options and examples, and the footer.
/// @param see_also names with their section, separated by commas, e.g. "eigenposed(8)"; may be empty.
std::string man_page(const CLI::App& app, int section, const std::string& see_also);

/// Adds the flag `--man`, which is not listed by --help: prints the manual page and ends with CLI::Success.
void add_man_flag(CLI::App& app, int section, const std::string& see_also);

}  // namespace eigenpose
