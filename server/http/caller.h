// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Who sent a request, and what it may do.
#pragma once

#include <string>

namespace pliant::server {

// What a caller must be allowed to do; each includes those before it.
enum class Scope { kPublic, kRead, kWrite, kAdmin };

// "public", "read", "write", "admin"
inline const char* ScopeName(Scope scope) {
  switch (scope) {
    case Scope::kPublic:
      return "public";
    case Scope::kRead:
      return "read";
    case Scope::kWrite:
      return "write";
    case Scope::kAdmin:
      return "admin";
  }
  return "admin";
}

struct Caller {
  std::string key_id = {};  // of the API key that was shown; empty when none was needed
  std::string key_name = {};
  Scope scope = Scope::kPublic;
};

}  // namespace pliant::server
