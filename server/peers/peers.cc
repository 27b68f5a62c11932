// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/peers/peers.h"

#include <algorithm>
#include <deque>
#include <fstream>
#include <map>
#include <optional>
#include <random>
#include <system_error>
#include <utility>

#include <CLI/CLI.hpp>
#include <curl/curl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
#include "descriptor/base/strings.h"
#include "index/files/text.h"

namespace pliant::server {
namespace {

using Clock = PartServers::Clock;
using std::chrono::duration_cast;
using std::chrono::milliseconds;

constexpr milliseconds kStateTimeout{1000};
// A server that failed or was overtaken is asked last for so long.
constexpr milliseconds kAvoidFor{1000};
// The second server of a part is asked when the first takes longer than 95 of 100 of its last
// answers, and at least this ("hedged requests": Dean and Barroso, "The tail at scale", CACM 2013).
constexpr milliseconds kLeastHedge{10};
constexpr milliseconds kFirstHedge{200};  // until there are answers
constexpr std::size_t kLeastAnswers = 20;
constexpr std::size_t kAnswers = 100;

constexpr std::chrono::seconds kAskStatesEvery{3};
constexpr std::size_t kMostReplyBytes = std::size_t{256} << 20U;

void Require(bool done) {
  if (!done) throw std::runtime_error("libcurl ran out of memory");
}

// Waits until something happens. Returns the number of requests that run.
int Advance(CURLM* multi, Clock::duration at_most) {
  const auto ms = static_cast<int>(duration_cast<milliseconds>(at_most).count()) + 1;
  int running = 0;
  Require(curl_multi_poll(multi, nullptr, 0, ms, nullptr) == CURLM_OK &&
          curl_multi_perform(multi, &running) == CURLM_OK);
  return running;
}

// Another number than `bytes` ends the request.
std::size_t OnBody(const char* data, std::size_t, std::size_t bytes, void* text) {
  auto& body = *static_cast<std::string*>(text);
  if (body.size() + bytes > kMostReplyBytes) return 0;
  body.append(data, bytes);
  return bytes;
}

// One request that runs until this ends.
struct Call {
  CURLM* const multi;
  const std::size_t part;
  const std::size_t server;
  const Clock::time_point began = Clock::now();
  std::string body = {};  // of the answer
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle{curl_easy_init(),
                                                                   curl_easy_cleanup};

  ~Call() { curl_multi_remove_handle(multi, handle.get()); }
};

}  // namespace

PeerLayout ReadPeerLayout(const std::filesystem::path& file) {
  const auto fail = [&](const std::string& why) {
    throw Error(ErrorCode::kInvalidArgument, "peers_invalid",
                "the file of --peers, " + file.string() + ", " + why);
  };
  std::ifstream in(file);
  if (!in.is_open()) fail("cannot be read");
  PeerLayout layout;
  std::vector<CLI::ConfigItem> items;
  try {
    items = CLI::ConfigTOML().from_config(in);
  } catch (const CLI::Error& error) {
    fail(std::string("is no TOML: ") + error.what());
  }
  for (const CLI::ConfigItem& item : items) {
    if (item.name == "++" || item.name == "--") continue;  // begin and end of a section
    const std::string name = item.fullname();
    const std::string value = item.inputs.size() == 1 ? item.inputs.front() : "";
    if (name == "key") {
      layout.key = value;
    } else if (name == "timeout_ms") {
      const int ms = NumberOf<int>(value).value_or(0);
      if (ms < 1 || ms > 600'000) fail("has a timeout_ms that is not 1 to 600000");
      layout.timeout = milliseconds(ms);
    } else if (name == "parts." + std::to_string(layout.parts.size() + 1)) {
      if (item.inputs.empty()) fail("lists no servers for " + name);
      layout.parts.push_back(item.inputs);
      for (std::string& address : layout.parts.back()) {
        if (address.ends_with('/')) address.pop_back();
        if (!address.starts_with("http://") && !address.starts_with("https://")) {
          fail("has the address '" + address + "', which is not http:// or https://");
        }
      }
    } else {
      fail("has an unknown entry " + name + ". It takes the parts 1, 2, ... in order");
    }
  }
  if (layout.parts.empty()) fail("lists no servers");
  return layout;
}

// The servers of one state of the file.
class PeerServers : public PartServers {
 public:
  PeerServers(PeerLayout of_file, Peers::OnRequest on_request)
      : layout(std::move(of_file)), on_request_(std::move(on_request)) {
    const std::string key = "Authorization: Bearer " + layout.key;
    Require(headers_ && curl_slist_append(headers_.get(), "Expect:") != nullptr);
    Require(layout.key.empty() || curl_slist_append(headers_.get(), key.c_str()) != nullptr);
    for (const auto& part : layout.parts) known_.emplace_back(part.size());
  }

  milliseconds timeout() const override { return layout.timeout; }
  Replies Ask(const std::string& whole, const std::string& to_kept, const Replies& first,
              Clock::time_point until) override;
  std::vector<PeerState> States();

  // Has open connections, if one is idle, and is idle again when the pointer ends.
  std::shared_ptr<CURLM> Borrow() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) idle_.emplace_back(curl_multi_init(), curl_multi_cleanup);
    auto multi = std::move(idle_.back());
    idle_.pop_back();
    Require(multi != nullptr);
    return {multi.release(), [this](CURLM* used) {
              const std::lock_guard again(mutex_);
              idle_.emplace_back(used, curl_multi_cleanup);
            }};
  }

  // `message`: to POST; not copied.
  std::unique_ptr<Call> Start(CURLM* multi, std::size_t part, std::size_t server,
                              const std::string& path, milliseconds timeout,
                              const std::string* message = nullptr) const {
    std::unique_ptr<Call> call(new Call{multi, part, server});
    CURL* const handle = call->handle.get();
    Require(handle != nullptr);
    curl_easy_setopt(handle, CURLOPT_URL, (layout.parts[part][server] + path).c_str());
    curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers_.get());
    curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS, static_cast<long>(timeout.count()));
    curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(handle, CURLOPT_PROXY, "");
    curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, OnBody);
    curl_easy_setopt(handle, CURLOPT_WRITEDATA, &call->body);
    curl_easy_setopt(handle, CURLOPT_PRIVATE, call.get());
    if (message != nullptr) {
      curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE_LARGE,
                       static_cast<curl_off_t>(message->size()));
      curl_easy_setopt(handle, CURLOPT_POSTFIELDS, message->data());
    }
    Require(curl_multi_add_handle(multi, handle) == CURLM_OK);
    return call;
  }

  // How long to wait for the call before another server is asked too.
  milliseconds Hedge(const Call& call) {
    const std::lock_guard lock(mutex_);
    auto sorted = known_[call.part][call.server].answered_in;
    if (sorted.size() < kLeastAnswers) return kFirstHedge;
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() * 95 / 100);
    std::ranges::nth_element(sorted, at);
    return std::max(kLeastHedge, *at);
  }

  void Note(const Call& call, PeerOutcome outcome, bool is_slow = false) {
    const auto took = Clock::now() - call.began;
    on_request_(call.part, outcome, std::chrono::duration<double>(took).count());
    const std::lock_guard lock(mutex_);
    Known& known = known_[call.part][call.server];
    const bool answered = outcome == PeerOutcome::kAnswered;
    if (answered || is_slow) {  // which takes longer still
      known.answered_in.push_back(duration_cast<milliseconds>(took));
      if (known.answered_in.size() > kAnswers) known.answered_in.pop_front();
    }
    if (answered) known.avoid_until = {};
    if (outcome == PeerOutcome::kFailed || is_slow) known.avoid_until = Clock::now() + kAvoidFor;
  }

  const PeerLayout layout;

 private:
  struct Known {
    std::deque<milliseconds> answered_in;  // the last ones, in either step
    Clock::time_point avoid_until{};
  };

  const Peers::OnRequest on_request_;
  const std::unique_ptr<curl_slist, decltype(&curl_slist_free_all)> headers_{
      curl_slist_append(nullptr, "Content-Type: application/octet-stream"), curl_slist_free_all};
  std::mutex mutex_;                       // guards the rest
  std::vector<std::vector<Known>> known_;  // by part and server
  std::vector<std::unique_ptr<CURLM, decltype(&curl_multi_cleanup)>> idle_;
  std::size_t turn_ = std::random_device()();  // who of a part is asked first
};

namespace {

// One step of one ranking, on the thread that waits for it.
class Exchange {
 public:
  struct Turn {
    std::size_t server = 0;
    const std::string* message = nullptr;
  };

  explicit Exchange(PeerServers& servers)
      : servers_(servers), multi_(servers.Borrow()), replies_(servers.layout.parts.size()) {}

  void Add(std::size_t part, std::deque<Turn> turns) { parts_[part].turns = std::move(turns); }

  PartServers::Replies Run(Clock::time_point until) {
    for (auto now = Clock::now(); now < until && !parts_.empty(); now = Clock::now()) {
      auto wake = until;
      for (auto& [number, part] : parts_) {
        const bool is_due = part.running.empty() || now >= part.hedge_at;
        if (is_due && part.CanAsk()) AskNext(number, part, until - now);
        if (part.CanAsk()) wake = std::min(wake, part.hedge_at);
      }
      Advance(multi_.get(), wake - now);
      TakeFinished();  // before waiting again: nothing wakes for what is finished
      std::erase_if(parts_, [](const auto& entry) {
        return entry.second.running.empty() && entry.second.turns.empty();
      });
    }
    for (const auto& [number, part] : parts_) {
      for (const auto& call : part.running) servers_.Note(*call, PeerOutcome::kFailed);
    }
    return std::move(replies_);
  }

 private:
  struct Part {  // without a reply
    std::deque<Turn> turns;
    std::vector<std::unique_ptr<Call>> running;
    Clock::time_point hedge_at{};

    // A server that works on the part need not begin again.
    bool CanAsk() const {
      const auto works = [&](const auto& call) { return call->server == turns.front().server; };
      return !turns.empty() && std::ranges::none_of(running, works);
    }
  };

  void AskNext(std::size_t number, Part& part, Clock::duration timeout) {
    const auto ms = std::max(milliseconds(1), duration_cast<milliseconds>(timeout));
    const std::string path = fmt::format("/v1/peer/rank?part={}&parts={}&timeout_ms={}", number + 1,
                                         replies_.size(), ms.count());
    const auto [server, message] = part.turns.front();
    part.turns.pop_front();
    part.running.push_back(servers_.Start(multi_.get(), number, server, path, ms, message));
    part.hedge_at = Clock::now() + servers_.Hedge(*part.running.back());
  }

  void TakeFinished() {
    int left = 0;
    while (const CURLMsg* message = curl_multi_info_read(multi_.get(), &left)) {
      const CURLcode result = message->data.result;  // the message goes with its handle
      Call* call = nullptr;
      long status = 0;
      curl_easy_getinfo(message->easy_handle, CURLINFO_PRIVATE, &call);
      curl_easy_getinfo(message->easy_handle, CURLINFO_RESPONSE_CODE, &status);
      if (result == CURLE_OK && status == 200) {
        TakeAnswer(*call);
      } else {
        TakeFailure(*call, result, status);
      }
    }
  }

  void TakeAnswer(Call& answered) {
    for (const auto& call : parts_.at(answered.part).running) {
      const bool is_it = call.get() == &answered;
      servers_.Note(*call, is_it ? PeerOutcome::kAnswered : PeerOutcome::kOvertaken,
                    /*is_slow=*/call->began < answered.began);
    }
    replies_[answered.part] = {std::move(answered.body), answered.server};
    parts_.erase(answered.part);
  }

  void TakeFailure(const Call& failed, CURLcode result, long status) {
    std::string code;
    std::string why;
    try {
      const auto problem = nlohmann::json::parse(failed.body);
      code = problem.at("code");
      why = Shown(problem.at("detail").get<std::string>());
    } catch (const nlohmann::json::exception&) {  // no answer, or not of a server of Pliant
      why = result == CURLE_OK ? fmt::format("status {}", status) : curl_easy_strerror(result);
    }
    if (code != "part_changed") {
      spdlog::warn("peer {} did not rank part {}: {}",
                   servers_.layout.parts[failed.part][failed.server], failed.part + 1, why);
    }
    const bool refuses = code == "part_changed" || code == "part_elsewhere";
    servers_.Note(failed, refuses ? PeerOutcome::kRefused : PeerOutcome::kFailed);
    std::erase_if(parts_.at(failed.part).running,
                  [&](const auto& call) { return call.get() == &failed; });
  }

  PeerServers& servers_;
  const std::shared_ptr<CURLM> multi_;
  std::map<std::size_t, Part> parts_;
  PartServers::Replies replies_;
};

}  // namespace

PartServers::Replies PeerServers::Ask(const std::string& whole, const std::string& to_kept,
                                      const Replies& first, Clock::time_point until) {
  Exchange exchange(*this);
  std::unique_lock lock(mutex_);
  if (first.empty()) ++turn_;
  for (std::size_t part = 0; part < known_.size(); ++part) {
    const std::vector<Known>& known = known_[part];
    std::size_t keeps = known.size();  // nobody
    if (!first.empty()) {
      const std::optional<Reply>& reply = first[part];
      if (!reply) continue;
      keeps = reply->server;
    }
    std::deque<Exchange::Turn> turns;
    for (std::size_t i = 0; i < known.size(); ++i) {
      turns.push_back({(turn_ + i) % known.size(), &whole});
    }
    // Who keeps the votes is the last to begin again: it may have restarted without them.
    std::ranges::stable_sort(turns, {}, [&, now = Clock::now()](const Exchange::Turn& turn) {
      return std::pair(turn.server == keeps, known[turn.server].avoid_until > now);
    });
    if (!first.empty()) turns.push_front({keeps, &to_kept});
    exchange.Add(part, std::move(turns));
  }
  lock.unlock();
  return exchange.Run(until);
}

std::vector<PeerState> PeerServers::States() {
  std::vector<PeerState> states;
  const std::shared_ptr<CURLM> multi = Borrow();
  std::vector<std::unique_ptr<Call>> calls;
  for (std::size_t part = 0; part < layout.parts.size(); ++part) {
    for (std::size_t server = 0; server < layout.parts[part].size(); ++server) {
      calls.push_back(Start(multi.get(), part, server, "/v1/peer", kStateTimeout));
    }
  }
  while (Advance(multi.get(), kStateTimeout) > 0) continue;
  for (const auto& call : calls) {
    PeerState& state =
        states.emplace_back(static_cast<int>(call->part) + 1, static_cast<int>(call->server) + 1);
    try {
      const auto json = nlohmann::json::parse(call->body);
      state.followed = json.at("followed");
      state.database = json.at("database");
      state.answers = json.at("part") == state.part && json.at("parts") == layout.parts.size();
    } catch (const nlohmann::json::exception&) {
      continue;  // it did not answer, or is no server of Pliant
    }
  }
  return states;
}

Peers::Peers(std::filesystem::path file, OnRequest on_request)
    : file_(std::move(file)), on_request_(std::move(on_request)) {
  Require(curl_global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK);
  current_ = std::make_shared<PeerServers>(ReadPeerLayout(file_), on_request_);
  watcher_ = std::jthread([this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      std::vector<PeerState> states = CurrentServers()->States();
      std::unique_lock lock(mutex_);
      states_ = std::move(states);
      stopped_.wait_for(lock, stop, kAskStatesEvery, [] { return false; });
    }
  });
}

std::shared_ptr<PartServers> Peers::Current() { return CurrentServers(); }

std::shared_ptr<PeerServers> Peers::CurrentServers() {
  const std::lock_guard lock(mutex_);
  std::error_code missing;  // then the time is the least one
  const auto written = std::filesystem::last_write_time(file_, missing);
  if (written == read_at_) return current_;
  read_at_ = written;
  try {
    PeerLayout layout = ReadPeerLayout(file_);
    if (layout != current_->layout) {
      spdlog::info("searches now ask the {} parts of {}", layout.parts.size(), file_.string());
      current_ = std::make_shared<PeerServers>(std::move(layout), on_request_);
    }
  } catch (const Error& failure) {
    spdlog::error("{}; the servers stay as they were", failure.what());
  }
  return current_;
}

std::vector<PeerState> Peers::states() const {
  const std::lock_guard lock(mutex_);
  return states_;
}

}  // namespace pliant::server
