// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// The engine as Python holds it.
#pragma once

#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <pybind11/pybind11.h>

#include "descriptor/base/error.h"
#include "index/engine/engine.h"

namespace pliant::python {

// One collection of one database, until it is closed. Thread-safe: calls that are running when
// another thread closes it come to their end, and the last of them closes the database.
class OpenIndex {
 public:
  OpenIndex(std::shared_ptr<Engine> engine, std::string collection)
      : engine_(std::move(engine)), collection_(std::move(collection)) {}

  const std::string& collection() const { return collection_; }

  // Throws kInvalidArgument "closed" once it is closed.
  std::shared_ptr<Engine> engine() const {
    const std::lock_guard lock(mutex_);
    if (!engine_) throw Error(ErrorCode::kInvalidArgument, "closed", "the index is closed");
    return engine_;
  }
  bool is_open() const {
    const std::lock_guard lock(mutex_);
    return engine_ != nullptr;
  }
  void Close() {
    std::shared_ptr<Engine> last;
    const std::lock_guard lock(mutex_);
    last.swap(engine_);
  }

  // Calls work(engine, collection) without the GIL.
  template <typename Work>
  auto Call(Work work) const {
    const pybind11::gil_scoped_release release;
    const std::shared_ptr<Engine> open = engine();
    return work(*open, collection_);
  }

 private:
  mutable std::mutex mutex_;  // guards engine_
  std::shared_ptr<Engine> engine_;
  std::string collection_;
};

void BindImages(pybind11::class_<OpenIndex>& index);
void BindSearch(pybind11::class_<OpenIndex>& index);
void BindUpkeep(pybind11::class_<OpenIndex>& index);

}  // namespace pliant::python
