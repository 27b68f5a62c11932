// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/usage/help_format.h"

#include <set>

#include "index/usage/option_words.h"

namespace pliant::cli {
namespace {

std::string Names(const std::set<CLI::Option*>& options) {
  std::string names;
  for (const CLI::Option* option : options) {
    names += (names.empty() ? "" : ", ") + option->get_name(false, false);
  }
  return names;
}

}  // namespace

std::string HelpFormat::make_option_opts(const CLI::Option* option) const {
  const std::string value = option->nonpositional() ? ValueName(*option) : "";
  return value.empty() ? "" : " " + value;
}

std::string HelpFormat::make_option_desc(const CLI::Option* option) const {
  std::string notes;
  const auto note = [&notes](const std::string& text) {
    notes += (notes.empty() ? "" : "; ") + text;
  };
  if (const std::string range = ValueRange(*option); !range.empty()) note(range);
  if (!option->get_default_str().empty()) note("default: " + option->get_default_str());
  if (option->get_required() && option->nonpositional()) note("required");
  if (!option->get_needs().empty()) note("only with " + Names(option->get_needs()));
  if (!option->get_excludes().empty()) note("not with " + Names(option->get_excludes()));
  if (!option->get_envname().empty()) note("or in " + option->get_envname());
  const std::string& text = option->get_description();
  return notes.empty() ? text : text + " (" + notes + ")";
}

std::string HelpFormat::make_footer(const CLI::App* app) const {
  const std::string own = CLI::Formatter::make_footer(app);
  const CLI::App* above = app->get_parent();
  if (above == nullptr || !app->get_fallthrough()) return own;
  const auto options = above->get_options([&](const CLI::Option* option) {
    return option->nonpositional() && option != above->get_help_ptr() &&
           !option->get_group().empty();
  });
  if (options.empty()) return own;
  const std::string group = make_group("Options of every " + above->get_name(), false, options);
  const std::size_t begin = group.find_first_not_of('\n');  // lines are left free around a footer
  return group.substr(begin) + (app->get_footer().empty() ? "" : "\n" + own);
}

}  // namespace pliant::cli
