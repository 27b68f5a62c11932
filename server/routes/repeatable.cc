// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <mutex>
#include <set>
#include <string_view>
#include <utility>

#include <spdlog/spdlog.h>

#include "descriptor/base/sha256.h"
#include "server/http/json.h"
#include "server/http/parameters.h"
#include "server/http/problem.h"
#include "server/routes/routes.h"

namespace pliant::server {

namespace {

constexpr const char* kHeader = "Idempotency-Key";
constexpr std::size_t kLongestKey = 255;

std::string KeyOf(const Request& request) {
  std::string key = request.header(kHeader);
  const bool is_printable =
      std::all_of(key.begin(), key.end(), [](char c) { return c > ' ' && c <= '~'; });
  if (key.empty() || key.size() > kLongestKey || !is_printable ||
      request.headers.count(kHeader) != 1) {
    ThrowInvalid(kHeader, "Idempotency-Key must be one value of 1 to 255 printable characters.");
  }
  return key;
}

std::string FingerprintOf(const Request& request) {
  std::string hashes;
  const auto add = [&hashes](std::string_view part) { hashes += Sha256Hex(part); };
  add(request.method);
  add(request.path);
  for (const auto& [name, value] : request.query) {
    add(name);
    add(value);
  }
  add(request.content_type);
  if (!request.is_multipart()) {  // whose boundary differs each time
    add(request.received ? request.received->All() : std::string_view(request.body));
  }
  for (const Part& part : request.parts) {
    add(part.name);
    add(part.filename);
    add(part.content_type);
    add(part.content);
  }
  return Sha256Hex(hashes);
}

std::string Remembered(const Response& response) {
  return ToText({{"status", response.status},
                 {"content_type", response.content_type},
                 {"body", response.body},
                 {"headers", response.headers}});
}

Response Replayed(const std::string& remembered) {
  const Json json = Json::parse(remembered);
  Response response;
  response.status = json.at("status");
  response.content_type = json.at("content_type");
  response.body = json.at("body");
  response.headers = json.at("headers");
  response.headers.emplace_back("Idempotency-Replayed", "true");
  return response;
}

[[noreturn]] void ThrowRunning() {
  throw ProblemError("idempotency_running",
                     "The first request with this Idempotency-Key is still running.",
                     {.retry_after_s = 1});
}

// Requests with a key that run in this process, by caller and key.
struct Running {
  std::mutex mutex;
  std::set<std::pair<std::string, std::string>> names;
};

// No answer: the request failed. After a failure to store the answer, the server performs the
// request again when it comes again.
void End(ServiceStore& store, const RepeatableRequest& request,
         const std::optional<std::string>& answer) {
  try {
    store.EndRequest(request, answer);
  } catch (const std::exception& error) {
    spdlog::error("cannot store the answer to Idempotency-Key {}: {}", request.name, error.what());
  }
}

Response DoOnce(ServiceStore& store, const RepeatableRequest& name, const Handler& handler,
                const Request& request, const Parameters& parameters) {
  const RequestState state = store.BeginRequest(name);
  switch (state.kind) {
    case RequestState::kRunning:
      ThrowRunning();
    case RequestState::kOther:
      throw ProblemError("idempotency_other",
                         "This Idempotency-Key was already used for a different request.");
    case RequestState::kAnswered:
      return Replayed(state.answer);
    case RequestState::kBegun:
      break;
  }
  std::optional<std::string> answer;
  Response response;
  try {
    response = handler(request, parameters);
    if (response.status < 300) answer = Remembered(response);
  } catch (...) {
    End(store, name, std::nullopt);
    throw;
  }
  End(store, name, answer);
  return response;
}

}  // namespace

Handler Repeatable(Service& service, Handler handler) {
  return [&service, handler = std::move(handler), running = std::make_shared<Running>()](
             const Request& request, const Parameters& parameters) {
    if (!request.headers.contains(kHeader)) return handler(request, parameters);
    const RepeatableRequest name{request.caller.key_id, KeyOf(request), FingerprintOf(request)};
    std::unique_lock lock(running->mutex);
    const auto [at, is_new] = running->names.emplace(name.caller, name.name);
    if (!is_new) ThrowRunning();
    lock.unlock();
    const std::shared_ptr<void> ending(nullptr, [&running, at = at](void*) {
      const std::lock_guard again(running->mutex);
      running->names.erase(at);
    });
    return DoOnce(service.store(), name, handler, request, parameters);
  };
}

}  // namespace pliant::server
