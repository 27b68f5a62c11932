// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/option_words.h"

#include <algorithm>
#include <cctype>

namespace pliant::cli {
namespace {

void Collect(const CLI::App& app, const std::string& path, std::vector<NamedCommand>& all) {
  all.push_back({path, &app});
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    Collect(*sub, path + " " + sub->get_name(), all);
  }
}

}  // namespace

std::vector<NamedCommand> AllCommands(const CLI::App& program) {
  std::vector<NamedCommand> all;
  Collect(program, program.get_name(), all);
  return all;
}

std::vector<std::string> CommandNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    names.push_back(sub->get_name());
  }
  return names;
}

std::vector<std::string> ValueWords(const CLI::Option& option) {
  const std::string& text = option.get_option_text();
  std::vector<std::string> words;
  if (text.find('|') == std::string::npos) return words;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find('|', begin), text.size());
    words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  const bool all_words = std::all_of(words.begin(), words.end(), [](const std::string& word) {
    return !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
      return std::islower(c) != 0 || std::isdigit(c) != 0 || c == '-';
    });
  });
  if (!all_words) words.clear();
  return words;
}

bool TakesValue(const CLI::Option& option) { return option.get_expected_max() > 0; }

std::string ValueName(const CLI::Option& option) {
  if (!option.get_option_text().empty()) return option.get_option_text();
  if (!TakesValue(option)) return "";
  const std::string type = option.get_type_name();
  const std::string name = type.substr(0, type.find_first_of(" :"));
  return name == "INT" || name == "UINT" || name == "FLOAT" ? "N" : name;
}

std::string ValueRange(const CLI::Option& option) {
  if (!option.get_option_text().empty() || !TakesValue(option)) return "";
  const std::string type = option.get_type_name();
  const std::size_t colon = type.find(':');
  return colon == std::string::npos ? "" : type.substr(colon + 1);
}

std::vector<const CLI::Option*> DashedOptions(const CLI::App& app) {
  std::vector<const CLI::Option*> options = app.get_options([](const CLI::Option* option) {
    return option->nonpositional() && !option->get_group().empty();
  });
  if (app.get_parent() == nullptr || !app.get_fallthrough()) return options;
  for (const CLI::Option* option : DashedOptions(*app.get_parent())) {
    const bool help = option == app.get_parent()->get_help_ptr();
    if (!help) options.push_back(option);
  }
  return options;
}

std::vector<std::string> NamesOf(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  return names;
}

}  // namespace pliant::cli
