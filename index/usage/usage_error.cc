// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/usage_error.h"

#include <algorithm>
#include <numeric>
#include <utility>

namespace pliant::cli {
namespace {

// Levenshtein's distance: wrong, missing and additional characters.
std::size_t TypingErrors(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = std::exchange(row[j + 1], std::min({replaced, row[j] + 1, row[j + 1] + 1}));
    }
  }
  return row.back();
}

// What can follow: commands, or options if `word` begins with a dash.
std::vector<std::string> Names(const CLI::App& app, const std::string& word) {
  std::vector<std::string> names;
  if (word.starts_with('-')) {
    for (const CLI::Option* option : app.get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  } else {
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(sub->get_name());
    }
  }
  return names;
}

}  // namespace

std::string DidYouMean(const std::string& word, const std::vector<std::string>& names) {
  constexpr std::size_t kLongest = 100;  // the work grows with the product of both lengths
  if (word.size() > kLongest) return "";
  std::size_t fewest = (word.size() + 1) / 2 + 1;
  std::string closest;
  for (const std::string& name : names) {
    const std::size_t errors = TypingErrors(word, name);
    if (errors >= std::min(fewest, name.size())) continue;
    fewest = errors;
    closest = name;
  }
  return closest.empty() ? "" : "; did you mean " + closest + "?";
}

std::string UsageError(const CLI::App* program, const CLI::Error& error) {
  const CLI::App* app = program;  // then the innermost command: `pliant db check` is three apps
  std::string path = app->get_name();
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands().front();
    path += " " + app->get_name();
  }
  std::string text = error.what();
  const std::vector<std::string> unknown = program->remaining(true);
  const auto code = static_cast<CLI::ExitCodes>(error.get_exit_code());
  if (code == CLI::ExitCodes::ConfigError) {
    std::string name = text.substr(text.rfind(' ') + 1);
    name = "--" + name.substr(0, name.rfind(".++"));  // of a table
    text += DidYouMean(name, Names(*app, name));
  } else if (!unknown.empty() &&
             (code == CLI::ExitCodes::ExtrasError || code == CLI::ExitCodes::RequiredError)) {
    const std::string word = unknown.front().substr(0, unknown.front().find('='));
    text = path + " does not take " + word + DidYouMean(word, Names(*app, word));
  }
  return text + "\nRun " + path + " --help for more information.\n";
}

}  // namespace pliant::cli
