// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/peers/peers.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <map>
#include <optional>
#include <random>
#include <system_error>
#include <tuple>
#include <utility>

#include <curl/curl.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
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

constexpr long kOk = 200;

// The last durations of a server's answers. Guarded by its user.
class Durations {
 public:
  void Add(milliseconds one) {
    last_[next_++ % kAnswers] = one;
    count_ = std::min(count_ + 1, kAnswers);
  }
  milliseconds Hedge() const {
    if (count_ < kLeastAnswers) return kFirstHedge;
    auto sorted = last_;
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(count_ * 95 / 100);
    std::nth_element(sorted.begin(), at, sorted.begin() + static_cast<std::ptrdiff_t>(count_));
    return std::max(kLeastHedge, *at);
  }

 private:
  std::array<milliseconds, kAnswers> last_{};
  std::size_t next_ = 0;
  std::size_t count_ = 0;
};

// Another number than `bytes` ends the request.
std::size_t OnBody(const char* data, std::size_t, std::size_t bytes, void* text) {
  auto& body = *static_cast<std::string*>(text);
  if (body.size() + bytes > kMostReplyBytes) return 0;
  body.append(data, bytes);
  return bytes;
}

struct Refusal {
  std::string code;
  std::string detail;
};

// Empty unless it is a problem as Pliant's servers send it.
Refusal RefusalIn(const std::string& body) {
  try {
    const auto json = nlohmann::json::parse(body);
    return {json.at("code"), Shown(json.at("detail").get<std::string>())};
  } catch (const nlohmann::json::exception&) {
    return {};
  }
}

void Require(bool done) {
  if (!done) throw std::runtime_error("libcurl ran out of memory");
}

// One request that runs.
struct Call {
  std::size_t part = 0;
  std::size_t server = 0;
  Clock::time_point began = Clock::now();
  std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle{curl_easy_init(), curl_easy_cleanup};
  std::unique_ptr<curl_slist, decltype(&curl_slist_free_all)> headers{nullptr, curl_slist_free_all};
  std::string body;  // of the answer
};

using Multi = std::unique_ptr<CURLM, decltype(&curl_multi_cleanup)>;

}  // namespace

const char* PeerOutcomeName(PeerOutcome outcome) {
  constexpr const char* kNames[] = {"answered", "refused", "failed", "overtaken"};
  return kNames[static_cast<int>(outcome)];
}

class Peers::Servers : public PartServers {
 public:
  Servers(PeerLayout layout, OnRequest on_request)
      : layout_(std::move(layout)), on_request_(std::move(on_request)) {
    for (const auto& part : layout_.parts) known_.emplace_back(part.size());
    for (const auto& part : known_) turns_.push_back(std::random_device()() % part.size());
  }

  const PeerLayout& layout() const { return layout_; }
  int parts() const override { return static_cast<int>(layout_.parts.size()); }
  milliseconds timeout() const override { return layout_.timeout; }

  std::vector<std::optional<Reply>> Ask(const std::function<const std::string&()>& body,
                                        std::span<const Kept> kept, const std::string& to_kept,
                                        Clock::time_point until) override {
    Exchange exchange(*this);
    for (std::size_t part = 0; part < layout_.parts.size(); ++part) {
      if (!kept.empty() && kept[part].token.empty()) continue;
      exchange.AddPart(part, kept.empty() ? nullptr : &kept[part]);
    }
    return exchange.Run(body, to_kept, until);
  }

  std::vector<PeerState> States();

 private:
  struct Known {
    Durations durations;  // of either step
    Clock::time_point avoid_until{};
  };
  // One step of one ranking, on the thread that waits for it.
  class Exchange {
   public:
    explicit Exchange(Servers& all)
        : all_(all), multi_(all.Borrow()), replies_(all.layout_.parts.size()) {}
    ~Exchange();
    Exchange(const Exchange&) = delete;
    Exchange& operator=(const Exchange&) = delete;

    void AddPart(std::size_t part, const Kept* kept);
    std::vector<std::optional<Reply>> Run(const std::function<const std::string&()>& body,
                                          const std::string& to_kept, Clock::time_point until);

   private:
    struct Waiting {            // a part without a reply
      std::vector<Kept> turns;  // without a token: to be asked the whole
      std::size_t next = 0;
      std::size_t running = 0;
      bool refused = false;
      Clock::time_point hedge_at = Clock::time_point::max();
    };
    void Start(std::size_t part, const std::function<const std::string&()>& body,
               const std::string& to_kept, Clock::time_point until);
    bool CanHedge(std::size_t part, const Waiting& waiting) const;
    void TakeFinished();
    void Answered(const Call& call, std::string body);
    void End(std::size_t call, PeerOutcome outcome, bool slow = true);

    Servers& all_;
    Multi multi_;
    std::map<std::size_t, Waiting> waiting_;
    std::vector<std::unique_ptr<Call>> calls_;
    std::vector<std::optional<Reply>> replies_;
  };

  Multi Borrow() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) {
      Multi made(curl_multi_init(), curl_multi_cleanup);
      Require(made != nullptr);
      return made;
    }
    Multi multi = std::move(idle_.back());
    idle_.pop_back();
    return multi;
  }
  void GiveBack(Multi multi) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(multi));
  }
  // Of a part, in the order in which they are asked.
  std::vector<std::size_t> Order(std::size_t part, bool next) {
    const std::lock_guard lock(mutex_);
    const std::size_t count = known_[part].size();
    const std::size_t first = next ? turns_[part]++ : turns_[part];
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < count; ++i) order.push_back((first + i) % count);
    std::ranges::stable_sort(order, {}, [&, now = Clock::now()](std::size_t server) {
      return known_[part][server].avoid_until > now;
    });
    return order;
  }
  milliseconds Hedge(const Call& call) {
    const std::lock_guard lock(mutex_);
    return known_[call.part][call.server].durations.Hedge();
  }
  void Note(const Call& call, PeerOutcome outcome, bool slow) {
    const auto took = Clock::now() - call.began;
    on_request_(call.part, outcome, std::chrono::duration<double>(took).count());
    const std::lock_guard lock(mutex_);
    Known& known = known_[call.part][call.server];
    const bool answered = outcome == PeerOutcome::kAnswered;
    const bool was_slow = outcome == PeerOutcome::kOvertaken && slow;  // and took longer still
    if (answered || was_slow) known.durations.Add(duration_cast<milliseconds>(took));
    if (answered) known.avoid_until = {};
    if (outcome == PeerOutcome::kFailed || was_slow) known.avoid_until = Clock::now() + kAvoidFor;
  }
  std::unique_ptr<Call> Prepare(std::size_t part, std::size_t server, const std::string& path,
                                milliseconds timeout) const;

  const PeerLayout layout_;
  const OnRequest on_request_;
  std::mutex mutex_;                       // guards the rest
  std::vector<std::vector<Known>> known_;  // by part and server
  std::vector<Multi> idle_;                // with their open connections
  std::vector<std::size_t> turns_;         // by part: the server that is asked first
};

std::unique_ptr<Call> Peers::Servers::Prepare(std::size_t part, std::size_t server,
                                              const std::string& path, milliseconds timeout) const {
  auto call = std::make_unique<Call>();
  CURL* const handle = call->handle.get();
  Require(handle != nullptr);
  call->part = part;
  call->server = server;
  const auto add = [&](const std::string& header) {
    curl_slist* const longer = curl_slist_append(call->headers.get(), header.c_str());
    Require(longer != nullptr);
    (void)call->headers.release();
    call->headers.reset(longer);
  };
  add("Content-Type: application/octet-stream");
  add("Expect:");
  if (!layout_.key.empty()) add("Authorization: Bearer " + layout_.key);
  const auto ms = std::max<long>(1, static_cast<long>(timeout.count()));
  add("X-Pliant-Timeout-Ms: " + std::to_string(ms));
  curl_easy_setopt(handle, CURLOPT_URL, (layout_.parts[part][server] + path).c_str());
  curl_easy_setopt(handle, CURLOPT_HTTPHEADER, call->headers.get());
  curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS, ms);
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_PROXY, "");
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, OnBody);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, &call->body);
  return call;
}

Peers::Servers::Exchange::~Exchange() {
  for (const auto& call : calls_) {
    if (call) curl_multi_remove_handle(multi_.get(), call->handle.get());
  }
  all_.GiveBack(std::move(multi_));
}

void Peers::Servers::Exchange::AddPart(std::size_t part, const Kept* kept) {
  Waiting& waiting = waiting_[part];
  const std::vector<std::size_t> order = all_.Order(part, /*next=*/kept == nullptr);
  if (kept == nullptr) {
    for (const std::size_t server : order) waiting.turns.push_back({server, {}});
    return;
  }
  waiting.turns.push_back(*kept);
  for (const std::size_t server : order) {
    if (server != kept->server) waiting.turns.push_back({server, {}});
  }
  waiting.turns.push_back({kept->server, {}});  // it may have restarted without the votes
}

void Peers::Servers::Exchange::Start(std::size_t part,
                                     const std::function<const std::string&()>& body,
                                     const std::string& to_kept, Clock::time_point until) {
  Waiting& waiting = waiting_.at(part);
  const Kept& turn = waiting.turns[waiting.next++];
  const bool is_kept = !turn.token.empty();
  const auto now = Clock::now();
  std::string path =
      "/v1/peer/rank?part=" + std::to_string(part + 1) + "&parts=" + std::to_string(all_.parts());
  if (is_kept) path += "&token=" + turn.token;
  auto call = all_.Prepare(part, turn.server, path, duration_cast<milliseconds>(until - now));
  const std::string& text = is_kept ? to_kept : body();
  curl_easy_setopt(call->handle.get(), CURLOPT_POSTFIELDSIZE_LARGE,
                   static_cast<curl_off_t>(text.size()));
  curl_easy_setopt(call->handle.get(), CURLOPT_POSTFIELDS, text.data());  // not copied
  ++waiting.running;
  waiting.hedge_at = now + all_.Hedge(*call);
  Require(curl_multi_add_handle(multi_.get(), call->handle.get()) == CURLM_OK);
  calls_.push_back(std::move(call));
}

// A server that works on the part need not begin again.
bool Peers::Servers::Exchange::CanHedge(std::size_t part, const Waiting& waiting) const {
  if (waiting.next == waiting.turns.size()) return false;
  const std::size_t server = waiting.turns[waiting.next].server;
  const auto works = [&](const auto& call) {
    return call && call->part == part && call->server == server;
  };
  return std::ranges::none_of(calls_, works);
}

void Peers::Servers::Exchange::End(std::size_t i, PeerOutcome outcome, bool slow) {
  curl_multi_remove_handle(multi_.get(), calls_[i]->handle.get());
  all_.Note(*calls_[i], outcome, slow);
  calls_[i].reset();
}

void Peers::Servers::Exchange::Answered(const Call& call, std::string body) {
  const std::size_t part = call.part;
  replies_[part] = Reply{std::move(body), false, call.server};
  waiting_.erase(part);
  for (std::size_t i = 0; i < calls_.size(); ++i) {
    if (!calls_[i] || calls_[i]->part != part) continue;
    const bool is_it = calls_[i].get() == &call;
    const bool is_slower = !is_it && calls_[i]->began < call.began;
    if (!is_it) End(i, PeerOutcome::kOvertaken, is_slower);
  }
}

void Peers::Servers::Exchange::TakeFinished() {
  int left = 0;
  while (const CURLMsg* message = curl_multi_info_read(multi_.get(), &left)) {
    if (message->msg != CURLMSG_DONE) continue;
    const CURLcode code = message->data.result;  // the message goes with its handle
    const auto found = std::ranges::find_if(calls_, [&](const auto& call) {
      return call && call->handle.get() == message->easy_handle;
    });
    if (found == calls_.end()) continue;
    Call& call = **found;
    long status = 0;
    curl_easy_getinfo(call.handle.get(), CURLINFO_RESPONSE_CODE, &status);
    const bool answers = code == CURLE_OK && status == kOk;
    const Refusal refusal = answers ? Refusal() : RefusalIn(call.body);
    const bool has_changed = refusal.code == "part_changed";
    const bool refuses = code == CURLE_OK && (has_changed || refusal.code == "part_elsewhere");
    if (!answers && !has_changed) {
      spdlog::warn("peer {} did not rank part {}: {}", all_.layout_.parts[call.part][call.server],
                   call.part + 1,
                   code != CURLE_OK         ? std::string(curl_easy_strerror(code))
                   : refusal.detail.empty() ? "status " + std::to_string(status)
                                            : refusal.detail);
    }
    if (answers) {
      Answered(call, std::move(call.body));
    } else if (const auto waiting = waiting_.find(call.part); waiting != waiting_.end()) {
      --waiting->second.running;
      waiting->second.refused |= has_changed;
    }
    End(static_cast<std::size_t>(found - calls_.begin()), answers   ? PeerOutcome::kAnswered
                                                          : refuses ? PeerOutcome::kRefused
                                                                    : PeerOutcome::kFailed);
  }
}

std::vector<std::optional<PartServers::Reply>> Peers::Servers::Exchange::Run(
    const std::function<const std::string&()>& body, const std::string& to_kept,
    Clock::time_point until) {
  while (true) {
    int running = 0;
    Require(curl_multi_perform(multi_.get(), &running) == CURLM_OK);
    TakeFinished();  // before waiting: nothing wakes for what is finished
    const auto now = Clock::now();
    auto wake = until;
    for (auto at = waiting_.begin(); at != waiting_.end();) {
      const auto [number, part] = std::tie(at->first, at->second);
      if (part.running == 0 && part.next == part.turns.size()) {  // nobody is left
        if (part.refused) replies_[number] = Reply{{}, true, 0};
        at = waiting_.erase(at);
        continue;
      }
      const bool can_hedge = CanHedge(number, part);
      if (now < until && (part.running == 0 || (can_hedge && now >= part.hedge_at))) {
        Start(number, body, to_kept, until);
      }
      if (CanHedge(number, part)) wake = std::min(wake, part.hedge_at);
      ++at;
    }
    if (waiting_.empty() || now >= until) break;
    const auto wait = duration_cast<milliseconds>(wake - now) + milliseconds(1);
    Require(curl_multi_poll(multi_.get(), nullptr, 0, static_cast<int>(wait.count()), nullptr) ==
            CURLM_OK);
  }
  for (std::size_t i = 0; i < calls_.size(); ++i) {
    if (calls_[i]) End(i, PeerOutcome::kFailed);
  }
  return std::move(replies_);
}

std::vector<PeerState> Peers::Servers::States() {
  std::vector<PeerState> states;
  std::vector<std::unique_ptr<Call>> calls;
  Multi multi = Borrow();
  for (std::size_t part = 0; part < layout_.parts.size(); ++part) {
    for (std::size_t server = 0; server < layout_.parts[part].size(); ++server) {
      calls.push_back(Prepare(part, server, "/v1/peer", kStateTimeout));
      states.push_back({static_cast<int>(part) + 1, static_cast<int>(server) + 1});
      Require(curl_multi_add_handle(multi.get(), calls.back()->handle.get()) == CURLM_OK);
    }
  }
  int running = 1;
  while (running > 0 && curl_multi_perform(multi.get(), &running) == CURLM_OK && running > 0) {
    curl_multi_poll(multi.get(), nullptr, 0, static_cast<int>(kStateTimeout.count()), nullptr);
  }
  for (std::size_t i = 0; i < calls.size(); ++i) {
    long status = 0;
    curl_easy_getinfo(calls[i]->handle.get(), CURLINFO_RESPONSE_CODE, &status);
    curl_multi_remove_handle(multi.get(), calls[i]->handle.get());
    if (status != kOk) continue;
    try {
      const auto json = nlohmann::json::parse(calls[i]->body);
      states[i].followed = json.at("followed");
      states[i].database = json.at("database");
      states[i].answers = json.at("part") == states[i].part && json.at("parts") == parts();
    } catch (const nlohmann::json::exception&) {
      continue;  // it is no server of Pliant
    }
  }
  GiveBack(std::move(multi));
  return states;
}

Peers::Peers(std::filesystem::path file, OnRequest on_request)
    : file_(std::move(file)),
      on_request_(std::move(on_request)),
      current_(std::make_shared<Servers>(ReadPeerLayout(file_), on_request_)) {
  static const CURLcode once = curl_global_init(CURL_GLOBAL_DEFAULT);
  Require(once == CURLE_OK);
  watcher_ = std::jthread([this](const std::stop_token& stop) { Watch(stop); });
}

std::shared_ptr<PartServers> Peers::Current() { return CurrentServers(); }

std::shared_ptr<Peers::Servers> Peers::CurrentServers() {
  const std::lock_guard lock(mutex_);
  std::error_code missing;  // then the time is the least one
  const auto written = std::filesystem::last_write_time(file_, missing);
  if (written == read_at_) return current_;
  read_at_ = written;
  try {
    PeerLayout layout = ReadPeerLayout(file_);
    if (layout != current_->layout()) {
      spdlog::info("searches now ask the {} parts of {}", layout.parts.size(), file_.string());
      current_ = std::make_shared<Servers>(std::move(layout), on_request_);
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

void Peers::Watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::vector<PeerState> states = CurrentServers()->States();
    std::unique_lock lock(mutex_);
    states_ = std::move(states);
    stopped_.wait_for(lock, stop, kAskStatesEvery, [] { return false; });
  }
}

}  // namespace pliant::server
