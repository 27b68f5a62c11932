// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/repeatable.h"

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

std::string HashOf(std::string_view text) {
  return Sha256Hex({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

std::string FingerprintOf(const Request& request) {
  std::string hashes;
  const auto add = [&hashes](std::string_view part) { hashes += HashOf(part); };
  add(request.method);
  add(request.path);
  for (const auto& [name, value] : request.query) {
    add(name);
    add(value);
  }
  add(request.content_type);
  add(request.received ? request.received->All() : std::string_view(request.body));
  for (const Part& part : request.parts) {
    add(part.name);
    add(part.filename);
    add(part.content_type);
    add(part.content);
  }
  return HashOf(hashes);
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
                     "The request with this Idempotency-Key is still being done.")
      .RetryAfter(1);
}

// Requests with a key that this process is doing.
class Running {
 public:
  using Name = std::pair<std::string, std::string>;  // caller, key

  // Throws ProblemError "idempotency_running".
  void Begin(const Name& name) {
    const std::lock_guard lock(mutex_);
    if (!names_.insert(name).second) ThrowRunning();
  }
  void End(const Name& name) {
    const std::lock_guard lock(mutex_);
    names_.erase(name);
  }

 private:
  std::mutex mutex_;
  std::set<Name> names_;
};

// Forgets the request unless it was answered.
class Attempt {
 public:
  Attempt(ServiceStore& store, RepeatableRequest request)
      : store_(store), request_(std::move(request)) {}
  Attempt(const Attempt&) = delete;
  Attempt& operator=(const Attempt&) = delete;
  ~Attempt() {
    if (!ended_) End(std::nullopt);
  }

  void Answered(const Response& response) { End(Remembered(response)); }

 private:
  // What could not be written down is done anew when it is sent again.
  void End(const std::optional<std::string>& answer) {
    ended_ = true;
    try {
      store_.EndRequest(request_, answer);
    } catch (const std::exception& error) {
      spdlog::error("the answer to Idempotency-Key {} is not remembered: {}", request_.name,
                    error.what());
    }
  }

  ServiceStore& store_;
  const RepeatableRequest request_;
  bool ended_ = false;
};

Response DoOnce(Service& service, const RepeatableRequest& name, const Handler& handler,
                const Request& request, const Parameters& parameters) {
  const RequestState state = service.store().BeginRequest(name);
  switch (state.kind) {
    case RequestState::kRunning:
      ThrowRunning();
    case RequestState::kOther:
      throw ProblemError("idempotency_other",
                         "Another request had this Idempotency-Key within the last day.");
    case RequestState::kAnswered:
      return Replayed(state.answer);
    case RequestState::kBegun:
      break;
  }
  Attempt attempt(service.store(), name);
  Response response = handler(request, parameters);
  if (response.status < 300) attempt.Answered(response);
  return response;
}

}  // namespace

Handler Repeatable(Service& service, Handler handler) {
  return [&service, handler = std::move(handler), running = std::make_shared<Running>()](
             const Request& request, const Parameters& parameters) {
    if (!request.headers.contains(kHeader)) return handler(request, parameters);
    const RepeatableRequest name{request.caller.key_id, KeyOf(request), FingerprintOf(request)};
    running->Begin({name.caller, name.name});
    const auto end = [&](void*) { running->End({name.caller, name.name}); };
    const std::unique_ptr<void, decltype(end)> ending(running.get(), end);
    return DoOnce(service, name, handler, request, parameters);
  };
}

}  // namespace pliant::server
