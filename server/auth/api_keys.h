// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// API keys: "plk_<id>_<secret>", the id 8 hex digits that are no secret, the secret 256 random
// bits. The database stores the SHA-256 of the whole key. Unlike for passwords, a fast hash is
// right: nobody can guess 256 random bits, and the server checks every request.
#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "index/store/service_store.h"
#include "server/http/json.h"
#include "server/http/message.h"
#include "server/http/router.h"

namespace pliant::server {

struct NewKey {
  std::string key;  // shown only once
  ApiKeyRecord record;
};

// `scope` must not be kPublic.
NewKey MakeApiKey(const std::string& name, Scope scope);

// A key's name follows the rules of an object's name, and is not empty. Throws kInvalidArgument.
void CheckKeyName(const std::string& name);

// {"id", "name", "scope", "created_at", "revoked_at": a time or null}
Json KeyJson(const ApiKeyRecord& key);

// "read", "write", "admin", "peer"; nothing for other words.
std::optional<Scope> ScopeFromName(const std::string& name);

// The current keys of a database: changes by the command line count from the next request on.
// Thread-safe.
class KeyRing {
 public:
  // Checks whether there are keys and closes the database again. A missing database has none.
  // Throws what ServiceStore throws.
  explicit KeyRing(std::filesystem::path database);

  // Call it after the Engine is open, and not before: the Engine checks the file in a way that
  // drops the locks of open files. Throws what ServiceStore throws.
  void Open();

  // Whether the database has a key. Revoked keys count, so that revoking the last one closes the
  // server instead of opening it.
  bool InUse();

  // The owner of the request's key ("Authorization: Bearer KEY" or "X-API-Key: KEY"); nothing
  // without a key. Throws ProblemError "unauthorized" for a key that does not work, and "starting"
  // before Open().
  std::optional<Caller> Identify(const Request& request);

 private:
  void Refresh();  // mutex_ held

  const std::filesystem::path database_;
  std::mutex mutex_;  // guards all below
  std::unique_ptr<ServiceStore> store_;
  std::int64_t version_ = -1;
  std::vector<ApiKeyRecord> keys_;
  bool in_use_at_start_ = false;
};

}  // namespace pliant::server
