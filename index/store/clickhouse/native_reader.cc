// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/store/clickhouse/native_reader.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "descriptor/base/error.h"
#include "index/files/text.h"

namespace pliant::clickhouse {
namespace {

constexpr std::uint64_t kMaxNameBytes = 256;

[[noreturn]] void ThrowCorrupt(const std::string& what) {
  throw Error(ErrorCode::kCorrupt, "answer_corrupt",
              "an answer of ClickHouse is not as it was asked for: " + what);
}

}  // namespace

NativeReader::NativeReader(std::vector<NativeField> fields, NativeLimits limits)
    : fields_(std::move(fields)), limits_(limits) {}

void NativeReader::Take(std::string_view piece) {
  buffer_.erase(0, at_);
  at_ = 0;
  buffer_ += piece;
  while (Step()) {
  }
}

bool NativeReader::Next(NativeBlock& block) {
  if (ready_.empty()) return false;
  block = std::move(ready_.front());
  ready_.pop_front();
  return true;
}

void NativeReader::Finish() const {
  if (state_ != State::kCounts || at_ != buffer_.size()) ThrowCorrupt("it is cut short");
}

bool NativeReader::Step() {
  switch (state_) {
    case State::kCounts:
      return ReadCounts();
    case State::kField:
      return ReadField();
    case State::kEnds:
      return ReadEnds();
    case State::kValues:
      break;
  }
  return ReadValues();
}

bool NativeReader::PeekVarint(std::size_t& at, std::uint64_t& value) const {
  value = 0;
  for (int shift = 0; at < buffer_.size(); shift += 7) {
    const auto byte = static_cast<std::uint8_t>(buffer_[at++]);
    if (shift == 63 && byte > 1) ThrowCorrupt("a number has more than 64 bits");
    value |= std::uint64_t{byte & 127u} << shift;
    if (byte < 128) return true;
  }
  return false;
}

bool NativeReader::PeekText(std::size_t& at, std::uint64_t most, std::string_view& text) const {
  std::uint64_t size = 0;
  if (!PeekVarint(at, size)) return false;
  if (size > most) ThrowCorrupt("a text of " + std::to_string(size) + " bytes");
  if (buffer_.size() - at < size) return false;
  text = std::string_view(buffer_).substr(at, size);
  at += size;
  return true;
}

bool NativeReader::ReadCounts() {
  std::size_t at = at_;
  std::uint64_t columns = 0;
  std::uint64_t rows = 0;
  if (at == buffer_.size() || !PeekVarint(at, columns) || !PeekVarint(at, rows)) return false;
  const bool nothing = columns == 0 && rows == 0;
  if (columns != fields_.size() && !nothing) {
    ThrowCorrupt(std::to_string(columns) + " columns in place of " +
                 std::to_string(fields_.size()));
  }
  if (rows > limits_.rows) ThrowCorrupt("a block of " + std::to_string(rows) + " rows");
  at_ = at;
  if (columns == 0) return true;
  block_ = {};
  block_.rows = rows;
  bytes_left_ = limits_.block_bytes;
  state_ = State::kField;
  return true;
}

bool NativeReader::ReadField() {
  const NativeField& field = fields_[block_.columns.size()];
  std::size_t at = at_;
  std::string_view name;
  std::string_view type;
  if (!PeekText(at, kMaxNameBytes, name) || !PeekText(at, kMaxNameBytes, type)) return false;
  if (name != field.name || type != field.type.Name()) {
    ThrowCorrupt("the column " + ToDisplayText(name) + " " + ToDisplayText(type) + " in place of " +
                 field.name + " " + field.type.Name());
  }
  at_ = at;
  block_.columns.push_back({field, NoValues(field.type), {}});
  if (field.type.array) {
    Charge(block_.rows, sizeof(std::uint64_t));
    state_ = State::kEnds;
  } else {
    values_left_ = block_.rows;
    Charge(values_left_, ValueBytes(field.type));
    state_ = State::kValues;
  }
  return true;
}

// `count` values of `each` bytes are announced.
void NativeReader::Charge(std::uint64_t count, std::uint64_t each) {
  if (each == 0) return;
  if (count > bytes_left_ / each) ThrowCorrupt("a block of too many bytes");
  bytes_left_ -= count * each;
}

bool NativeReader::ReadEnds() {
  const std::size_t bytes = block_.rows * sizeof(std::uint64_t);
  if (buffer_.size() - at_ < bytes) return false;
  NativeColumn& column = block_.columns.back();
  column.ends.resize(block_.rows);
  if (bytes > 0) std::memcpy(column.ends.data(), buffer_.data() + at_, bytes);
  at_ += bytes;
  values_left_ = 0;
  for (const std::uint64_t end : column.ends) {
    if (end < values_left_) ThrowCorrupt("an array ends before it begins");
    values_left_ = end;
  }
  Charge(values_left_, std::max<std::uint64_t>(ValueBytes(column.field.type), 1));
  state_ = State::kValues;
  return true;
}

bool NativeReader::ReadStrings(std::vector<std::string>& values) {
  for (; values_left_ > 0; --values_left_) {
    std::size_t at = at_;
    std::string_view text;
    if (!PeekText(at, bytes_left_, text)) return false;
    bytes_left_ -= text.size();
    values.emplace_back(text);
    at_ = at;
  }
  FinishColumn();
  return true;
}

bool NativeReader::ReadValues() {
  NativeColumn& column = block_.columns.back();
  return std::visit(
      [&](auto& values) {
        using Value = typename std::decay_t<decltype(values)>::value_type;
        if constexpr (std::is_same_v<Value, std::string>) {
          return ReadStrings(values);
        } else {
          const std::size_t bytes = values_left_ * ValueBytes(column.field.type);
          if (buffer_.size() - at_ < bytes) return false;
          values.resize(bytes / sizeof(Value));
          if (bytes > 0) std::memcpy(values.data(), buffer_.data() + at_, bytes);
          at_ += bytes;
          FinishColumn();
          return true;
        }
      },
      column.values);
}

void NativeReader::FinishColumn() {
  values_left_ = 0;
  if (block_.columns.size() < fields_.size()) {
    state_ = State::kField;
    return;
  }
  state_ = State::kCounts;
  if (block_.rows > 0) ready_.push_back(std::move(block_));
  block_ = {};
}

}  // namespace pliant::clickhouse
