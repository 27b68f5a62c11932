// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/manual.h"

#include <algorithm>
#include <cctype>

#include "index/usage/option_words.h"

namespace pliant::cli {
namespace {

// groff_man(7): hyphens that are typed, and nothing at a line's start that is a request.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    const bool line_start = escaped.empty() || escaped.back() == '\n';
    if (line_start && (c == '.' || c == '\'')) escaped += "\\&";
    if (c == '\\') {
      escaped += "\\e";
    } else if (c == '-') {
      escaped += "\\-";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string Upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string OptionEntry(const CLI::Option& option) {
  std::string names;
  for (const std::string& name : NamesOf(option)) {
    names += (names.empty() ? "\\fB" : ", \\fB") + Escaped(name) + "\\fR";
  }
  if (names.empty()) names = "\\fI" + Escaped(option.get_name()) + "\\fR";
  const std::string value = option.nonpositional() ? ValueName(option) : "";
  if (!value.empty()) names += " \\fI" + Escaped(value) + "\\fR";
  std::string text = option.get_description();
  if (!ValueRange(option).empty()) text += " (" + ValueRange(option) + ")";
  if (!option.get_default_str().empty()) text += " (default: " + option.get_default_str() + ")";
  if (option.get_required() && option.nonpositional()) text += " (required)";
  return ".TP\n" + names + "\n" + Escaped(text) + "\n";
}

std::string Synopsis(const NamedCommand& command) {
  std::string text = ".B " + Escaped(command.path) + "\n";
  if (!command.app->get_subcommands([](const CLI::App*) { return true; }).empty()) {
    return text + ".I COMMAND\n[...]\n";
  }
  for (const CLI::Option* option : command.app->get_options()) {
    if (!option->nonpositional()) text += ".I " + Escaped(option->get_name()) + "\n";
  }
  return text + "[\\fIOPTIONS\\fR]\n";
}

std::string Entries(const CLI::App& app) {
  std::string text;
  for (const CLI::Option* option : app.get_options()) {
    if (!option->nonpositional()) text += OptionEntry(*option);
  }
  for (const CLI::Option* option : DashedOptions(app)) text += OptionEntry(*option);
  return text;
}

std::string Verbatim(const std::string& text) {
  return text.empty() ? "" : ".PP\n.nf\n" + Escaped(text) + "\n.fi\n";
}

}  // namespace

std::string ManualPage(const CLI::App& program, const std::string& version) {
  const std::string name = program.get_name();
  std::string text = ".TH " + Upper(Escaped(name)) + " 1 \"\" \"" + Escaped(version) +
                     "\" \"User Commands\"\n.SH NAME\n" + Escaped(name) + " \\- " +
                     Escaped(program.get_description()) + "\n.SH SYNOPSIS\n";
  const std::vector<NamedCommand> commands = AllCommands(program);
  for (const NamedCommand& command : commands) {
    if (&command != &commands.front()) text += ".br\n";
    text += Synopsis(command);
  }
  text += ".SH OPTIONS\n" + Entries(program);
  if (commands.size() > 1) text += ".SH COMMANDS\n";
  for (const NamedCommand& command : commands) {
    if (command.app == &program) continue;
    text += ".SS " + Escaped(command.path) + "\n" + Escaped(command.app->get_description()) +
            ".\n" + Entries(*command.app) + Verbatim(command.app->get_footer());
  }
  if (!program.get_footer().empty()) text += ".SH NOTES\n" + Verbatim(program.get_footer());
  return text;
}

}  // namespace pliant::cli
