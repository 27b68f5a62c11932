// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/keeper_probe.h"

#include <algorithm>
#include <cerrno>
#include <random>
#include <string_view>
#include <utility>

#include <poll.h>
#include <unistd.h>

namespace pliant::clickhouse {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr milliseconds kLongest{1000};
constexpr milliseconds kForOthers{20};  // once the first has answered
// Its answer is a text in any case, also where the word is not allowed.
constexpr std::string_view kQuestion = "srvr";
constexpr std::string_view kNotServing = "not currently serving";

class Probe {
 public:
  explicit Probe(const KeeperAddress& address)
      : fd_(socket(address.socket.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    if (fd_ < 0) return;
    const auto* where = reinterpret_cast<const sockaddr*>(&address.socket);
    if (connect(fd_, where, address.length) != 0 && errno != EINPROGRESS) Close();
  }
  Probe(Probe&& other) noexcept
      : fd_(std::exchange(other.fd_, -1)), asked_(other.asked_), serves_(other.serves_) {}
  Probe& operator=(Probe&&) = delete;
  ~Probe() { Close(); }

  bool waits() const { return fd_ >= 0; }
  bool serves() const { return serves_; }
  pollfd Wanted() const { return {fd_, static_cast<short>(asked_ ? POLLIN : POLLOUT), 0}; }

  // Something has happened.
  void Go() {
    char answer[512];
    if (!asked_) {
      asked_ = send(fd_, kQuestion.data(), kQuestion.size(), MSG_NOSIGNAL) > 0;
      if (!asked_) Close();
      return;
    }
    const ssize_t got = recv(fd_, answer, sizeof(answer), 0);
    serves_ =
        got > 0 && std::string_view(answer, static_cast<std::size_t>(got)).find(kNotServing) ==
                       std::string_view::npos;
    Close();
  }

 private:
  void Close() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }

  int fd_;
  bool asked_ = false;
  bool serves_ = false;
};

// Whether all of them are done.
bool Step(std::vector<Probe>& probes, milliseconds longest) {
  std::vector<pollfd> wanted;
  for (const Probe& probe : probes) wanted.push_back(probe.Wanted());  // < 0: left out
  poll(wanted.data(), wanted.size(), static_cast<int>(std::max(longest, milliseconds(0)).count()));
  bool done = true;
  for (std::size_t i = 0; i < probes.size(); ++i) {
    if (probes[i].waits() && wanted[i].revents != 0) probes[i].Go();
    done = done && !probes[i].waits();
  }
  return done;
}

}  // namespace

void SortByAnswer(std::vector<KeeperAddress>& addresses, Clock::time_point until) {
  std::shuffle(addresses.begin(), addresses.end(), std::minstd_rand(std::random_device{}()));
  if (addresses.size() < 2) return;
  std::vector<Probe> probes;
  for (const KeeperAddress& address : addresses) probes.emplace_back(address);
  Clock::time_point end = std::min(until, Clock::now() + kLongest);
  bool answered = false;
  for (Clock::time_point now = Clock::now(); now < end; now = Clock::now()) {
    if (Step(probes, std::chrono::ceil<milliseconds>(end - now))) break;
    const bool first = !answered && std::any_of(probes.begin(), probes.end(),
                                                [](const Probe& probe) { return probe.serves(); });
    if (!first) continue;
    answered = true;
    end = std::min(end, Clock::now() + kForOthers);
  }
  std::vector<KeeperAddress> sorted;
  for (const bool serving : {true, false}) {
    for (std::size_t i = 0; i < addresses.size(); ++i) {
      if (probes[i].serves() == serving) sorted.push_back(addresses[i]);
    }
  }
  addresses = std::move(sorted);
}

}  // namespace pliant::clickhouse
