// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/store_figures.h"

#include <exception>
#include <utility>

#include <spdlog/spdlog.h>

namespace pliant::server {

namespace {

constexpr std::chrono::seconds kFresh{5};
constexpr std::chrono::milliseconds kMostWait{1000};

}  // namespace

std::optional<EngineStats> StoreFigures::Get() {
  if (!on_server_) return engine_.Stats();
  std::unique_lock lock(mutex_);
  const Clock::time_point start = Clock::now();
  if (start - asked_at_ > kFresh) {
    wanted_ = true;
    changed_.notify_all();
    if (!reader_.joinable()) {
      reader_ = std::jthread([this](const std::stop_token& stop) { Read(stop); });
    }
    changed_.wait_for(lock, kMostWait, [&] { return asked_at_ >= start; });
  }
  return stats_;
}

void StoreFigures::Read(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (changed_.wait(lock, stop, [this] { return wanted_; })) {
    wanted_ = false;
    lock.unlock();
    std::optional<EngineStats> stats;
    try {
      stats = engine_.Stats();
    } catch (const std::exception& error) {
      spdlog::warn("the figures of the database cannot be read: {}", error.what());
    }
    lock.lock();
    if (stats) stats_ = std::move(stats);
    asked_at_ = Clock::now();
    changed_.notify_all();
  }
}

}  // namespace pliant::server
