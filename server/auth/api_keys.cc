// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/auth/api_keys.h"

#include <algorithm>
#include <string_view>

#include <openssl/crypto.h>
#include <openssl/rand.h>

#include "descriptor/base/base64.h"
#include "descriptor/base/error.h"
#include "descriptor/base/hex.h"
#include "descriptor/base/sha256.h"
#include "descriptor/base/strings.h"
#include "descriptor/base/unix_time.h"
#include "index/files/names.h"
#include "index/store/open_store.h"
#include "server/http/problem.h"

namespace pliant::server {

namespace {

constexpr std::string_view kPrefix = "plk_";
constexpr std::size_t kIdDigits = 8;
constexpr std::size_t kSecretBytes = 32;

// The key in the headers; empty = none.
std::string ShownKey(const Request& request) {
  std::string shown = request.header("X-API-Key");
  const std::string authorization = request.header("Authorization");
  if (authorization.empty()) return shown;
  constexpr std::string_view kScheme = "bearer ";
  const bool bearer = EqualsIgnoringCase(authorization.substr(0, kScheme.size()), kScheme);
  if (!bearer || !shown.empty()) {
    throw ProblemError(
        "unauthorized",
        "Send the key as either \"Authorization: Bearer KEY\" or \"X-API-Key: KEY\".");
  }
  return authorization.substr(kScheme.size());
}

std::string IdOf(const std::string& key) {
  const bool formed = key.starts_with(kPrefix) && key.size() > kPrefix.size() + kIdDigits &&
                      key[kPrefix.size() + kIdDigits] == '_';
  return formed ? key.substr(kPrefix.size(), kIdDigits) : std::string();
}

}  // namespace

NewKey MakeApiKey(const std::string& name, Scope scope) {
  std::string secret(kSecretBytes, '\0');
  if (RAND_bytes(reinterpret_cast<unsigned char*>(secret.data()), kSecretBytes) != 1) {
    throw Error(ErrorCode::kInternal, "no_randomness", "the system provides no random numbers");
  }
  NewKey made;
  made.record.id = RandomHex(kIdDigits);
  made.record.name = name;
  made.record.scope = ScopeName(scope);
  made.record.created_ms = NowMs();
  made.key = std::string(kPrefix) + made.record.id + "_" + Base64UrlEncode(secret);
  made.record.hash = Sha256Hex(made.key);
  return made;
}

void CheckKeyName(const std::string& name) {
  CheckName(name, "name");
  if (name.empty()) {
    throw Error(ErrorCode::kInvalidArgument, "name_invalid", "name must not be empty.");
  }
}

Json KeyJson(const ApiKeyRecord& key) {
  return {{"id", key.id},
          {"name", key.name},
          {"scope", key.scope},
          {"created_at", IsoTime(key.created_ms)},
          {"revoked_at", key.revoked_ms == 0 ? Json(nullptr) : Json(IsoTime(key.revoked_ms))}};
}

std::optional<Scope> ScopeFromName(const std::string& name) {
  for (const Scope scope : {Scope::kRead, Scope::kWrite, Scope::kAdmin, Scope::kPeer}) {
    if (name == ScopeName(scope)) return scope;
  }
  return std::nullopt;
}

KeyRing::KeyRing(std::filesystem::path database) : database_(std::move(database)) {
  try {
    in_use_at_start_ = !OpenServiceStore(database_)->Keys().empty();
  } catch (const Error& error) {
    if (error.reason() != "database_not_found") throw;
  }
}

void KeyRing::Open() {
  const std::lock_guard lock(mutex_);
  if (!store_) store_ = OpenServiceStore(database_);
}

void KeyRing::Refresh() {
  const std::int64_t version = store_->Version();
  if (version == version_) return;
  keys_ = store_->Keys();
  version_ = version;
}

bool KeyRing::InUse() {
  const std::lock_guard lock(mutex_);
  if (!store_) return in_use_at_start_;
  Refresh();
  return !keys_.empty();
}

std::optional<Caller> KeyRing::Identify(const Request& request) {
  const std::string shown = ShownKey(request);
  if (shown.empty()) return std::nullopt;
  const std::string hash = Sha256Hex(shown);
  const std::lock_guard lock(mutex_);
  if (!store_) throw ProblemError("starting", "The server is starting. Try again shortly.");
  Refresh();
  const std::string id = IdOf(shown);
  const auto key = std::find_if(keys_.begin(), keys_.end(),
                                [&](const ApiKeyRecord& one) { return one.id == id; });
  if (key != keys_.end() && key->revoked_ms == 0 && key->hash.size() == hash.size() &&
      CRYPTO_memcmp(key->hash.data(), hash.data(), hash.size()) == 0) {
    if (const auto scope = ScopeFromName(key->scope)) return Caller{key->id, key->name, *scope};
  }
  throw ProblemError("unauthorized", "This key is unknown or revoked. Use a valid key.");
}

}  // namespace pliant::server
