// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// API keys: "plk_<id>_<secret>", the id 8 hex digits that anybody may see, the secret 256 random
// bits. Stored is the SHA-256 of the whole key. A fast hash is right here, other than for
// passwords: nobody can guess 256 random bits however fast he tries, so there is nothing that a
// slow hash could slow down, and every request has to be checked.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "index/store/service_store.h"
#include "server/http/json.h"
#include "server/http/message.h"
#include "server/http/router.h"

namespace pliant::server {

struct NewKey {
  std::string key;  // the only time that anybody sees it
  ApiKeyRecord record;
};

// `scope` must not be kPublic.
NewKey MakeApiKey(const std::string& name, Scope scope);

// A key's name is for people: it has the rules of an object's name, and is not empty. Throws
// kInvalidArgument.
void CheckKeyName(const std::string& name);

// {"id", "name", "scope", "created_at", "revoked_at": a time or null}
Json KeyJson(const ApiKeyRecord& key);

// "read", "write", "admin"; nothing for other words.
std::optional<Scope> ScopeFromName(const std::string& name);

// The keys of a database, as they are now: what the command line changes counts from the next
// request on. Thread-safe.
class KeyRing {
 public:
  // Looks whether there are keys and closes the database again. It need not exist yet: then there
  // are none. Throws what ServiceStore throws.
  explicit KeyRing(std::filesystem::path database);

  // To be called when the Engine is open, and not before: it looks at the file in a way that would
  // drop the locks of what is open already. Throws what ServiceStore throws.
  void Open();

  // Whether a key was ever made and not forgotten; also one that is revoked counts, so that
  // revoking the last one closes the server instead of opening it.
  bool InUse();

  // Whose key the request shows ("Authorization: Bearer KEY" or "X-API-Key: KEY"); nothing when
  // it shows none. Throws ProblemError "unauthorized" for one that does not work, and "starting"
  // before Open().
  std::optional<Caller> Identify(const Request& request);

 private:
  void Refresh();  // mutex_ held

  const std::filesystem::path database_;
  std::mutex mutex_;  // guards all below
  std::unique_ptr<ServiceStore> store_;
  std::int64_t version_ = -1;
  std::map<std::string, ApiKeyRecord> keys_;  // by id
  bool in_use_at_start_ = false;
};

}  // namespace pliant::server
