// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// A fixed array of plain values: its own, or a part of a mapped file. Private to index/.
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace pliant {

template <typename T>
class Array {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  Array() = default;
  explicit Array(std::vector<T> values) : own_(std::move(values)), values_(own_) {}
  // `owner` keeps the values where they are.
  Array(std::span<const T> values, std::shared_ptr<const void> owner)
      : owner_(std::move(owner)), values_(values) {}
  // The values of a vector stay where they are when it is moved.
  Array(Array&&) noexcept = default;
  Array& operator=(Array&&) noexcept = default;

  std::size_t size() const { return values_.size(); }
  const T* data() const { return values_.data(); }
  const T& operator[](std::size_t i) const { return values_[i]; }
  auto begin() const { return values_.begin(); }
  auto end() const { return values_.end(); }
  std::span<const T> span() const { return values_; }
  std::size_t memory_bytes() const { return values_.size() * sizeof(T); }

 private:
  std::vector<T> own_;
  std::shared_ptr<const void> owner_;
  std::span<const T> values_;
};

}  // namespace pliant
