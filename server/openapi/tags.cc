// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/openapi/tags.h"

#include <map>
#include <set>

namespace pliant::server {

std::string TagOf(const Route& route) {
  static const std::map<std::string, std::string> tags = {
      {"livez", "health"}, {"readyz", "health"}, {"metrics", "health"},
      {"openapi", "page"}, {"me", "keys"},       {"preview", "images"}};
  const std::string first = route.name.substr(0, route.name.find('.'));
  const auto tag = tags.find(first);
  return tag == tags.end() ? first : tag->second;
}

Json TagsOf(const std::vector<Route>& routes) {
  static const std::map<std::string, std::string> meanings = {
      {"aliases", "Other names of collections, moved from one to another at once"},
      {"backups", "Copies of the database in the operator's directory"},
      {"collections", "Separate sets of pictures, objects and vocabularies"},
      {"compare", "Two pictures, whether stored or not"},
      {"demo", "Demonstration objects for a first try"},
      {"health", "Whether the server lives, whether it is ready, how it is doing"},
      {"images", "Pictures: adding, reading, changing, deleting"},
      {"imports", "Pictures of a folder on the server"},
      {"jobs", "What runs in the background"},
      {"keys", "API keys, and what the caller may do"},
      {"objects", "What the pictures show"},
      {"page", "The web page, and this document"},
      {"search", "Which object is this?"},
      {"vocabularies", "Visual words: training, choosing"}};
  std::set<std::string> used;
  for (const Route& route : routes) used.insert(TagOf(route));
  Json tags = Json::array();
  for (const std::string& name : used) {
    const auto meaning = meanings.find(name);
    tags.push_back(
        {{"name", name}, {"description", meaning == meanings.end() ? name : meaning->second}});
  }
  return tags;
}

}  // namespace pliant::server
