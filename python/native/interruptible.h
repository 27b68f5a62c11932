// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Long work beside which Ctrl-C works.
#pragma once

#include <chrono>
#include <exception>
#include <functional>
#include <future>
#include <mutex>
#include <stop_token>
#include <utility>

#include <pybind11/pybind11.h>

namespace pliant::python {

// A function of Python's that is called from threads of C++'s. What it raises stops the work, and
// `Rethrow` raises it again. Made and destroyed with the GIL held.
class Callback {
 public:
  Callback(pybind11::object function, std::stop_source& stop)
      : function_(std::move(function)), stop_(stop) {}

  // Call without the GIL.
  template <typename... Arguments>
  void operator()(Arguments... arguments) {
    if (function_.is_none() || stop_.stop_requested()) return;
    const pybind11::gil_scoped_acquire gil;
    if (raised_) return;
    try {
      function_(arguments...);
    } catch (pybind11::error_already_set&) {
      raised_ = std::current_exception();
      stop_.request_stop();
    }
  }

  void Rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  pybind11::object function_;
  std::stop_source& stop_;
  std::exception_ptr raised_;  // guarded by the GIL
};

// Runs `work` in a thread of its own without the GIL, and looks for Ctrl-C meanwhile: then it asks
// `stop`, waits for the end, and raises KeyboardInterrupt. Called with the GIL held.
template <typename Work>
auto Interruptibly(std::stop_source& stop, const Callback& callback, Work work) {
  auto result = std::async(std::launch::async, std::move(work));
  const auto ready = [&result](std::chrono::milliseconds patience) {
    const pybind11::gil_scoped_release release;
    return result.wait_for(patience) == std::future_status::ready;
  };
  while (!ready(std::chrono::milliseconds(50))) {
    if (PyErr_CheckSignals() == 0) continue;
    const pybind11::error_already_set raised;  // takes what the signal's handler raised
    stop.request_stop();
    while (!ready(std::chrono::hours(1))) {
    }
    throw raised;
  }
  callback.Rethrow();
  return result.get();
}

}  // namespace pliant::python
