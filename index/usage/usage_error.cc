// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/usage_error.h"

#include <string_view>
#include <vector>

#include "index/usage/closest_name.h"
#include "index/usage/option_words.h"

namespace pliant::cli {
namespace {

// The command that was begun: "pliant eval matching" is three apps.
const CLI::App* Innermost(const CLI::App* app, std::string& path) {
  path = app->get_name();
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands().front();
    path += " " + app->get_name();
  }
  return app;
}

std::vector<std::string> OptionNames(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : DashedOptions(app)) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

// What nothing was made of, of any of the apps that were begun.
std::vector<std::string> Leftover(const CLI::App* app) {
  std::vector<std::string> words = app->remaining();
  while (words.empty() && !app->get_subcommands().empty()) {
    app = app->get_subcommands().front();
    words = app->remaining();
  }
  return words;
}

// What is said about it; empty = there is nothing.
std::string Unexpected(const CLI::App& app, const std::string& path,
                       const std::vector<std::string>& words) {
  const std::vector<std::string> commands = CommandNames(app);
  for (const std::string& word : words) {
    if (word.size() > 1 && word[0] == '-') {
      const std::string name = word.substr(0, word.find('='));
      return path + " has no option " + name + DidYouMean(name, OptionNames(app));
    }
    if (!commands.empty()) {
      return path + " has no command " + word + DidYouMean(word, commands);
    }
  }
  return words.empty() ? "" : path + " takes no further argument: " + words.front();
}

// A line of the configuration file that sets no flag. CLI11 ends its message with the name.
std::string UnknownSetting(const CLI::App& app, const std::string& path, const std::string& what) {
  std::string name = what.substr(what.rfind("parse ") + 6);
  name = name.substr(0, name.rfind(".++"));  // of a table
  return path + ": the configuration file sets \"" + name +
         "\", which is no flag without its dashes" + DidYouMean("--" + name, OptionNames(app));
}

}  // namespace

std::string UsageError(const CLI::App* program, const CLI::Error& error) {
  std::string path;
  const CLI::App& app = *Innermost(program, path);
  const auto is = [&error](CLI::ExitCodes code) {
    return error.get_exit_code() == static_cast<int>(code);
  };
  std::string text;
  if (is(CLI::ExitCodes::RequiredError) || is(CLI::ExitCodes::ExtrasError)) {
    text = Unexpected(app, path, Leftover(program));  // is more telling than what is missing
  }
  if (text.empty() && is(CLI::ExitCodes::RequiredError) && !CommandNames(app).empty()) {
    text = path + " needs a command:";
    for (const std::string& name : CommandNames(app)) text += " " + name;
  }
  if (error.get_name() == "ConfigError" &&
      std::string_view(error.what()).find("not able to parse") != std::string_view::npos) {
    text = UnknownSetting(app, path, error.what());
  }
  if (text.empty()) text = error.what();
  const std::size_t colon = text.find(": ");
  if (is(CLI::ExitCodes::ArgumentMismatch) && text.ends_with("missing") &&
      colon != std::string::npos) {
    text = text.substr(0, colon) + " needs a value";
  }
  return text + "\nRun " + path + " --help for more information.\n";
}

}  // namespace pliant::cli
