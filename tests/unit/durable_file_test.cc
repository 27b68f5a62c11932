// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "index/files/durable_file.h"

#include <cerrno>
#include <string>

#include <gtest/gtest.h>

#include "tests/unit/expect_error.h"

namespace pliant {
namespace {

void ExpectFor(int code, ErrorCode expected, const std::string& reason) {
  testing::ExpectError(expected, reason, [&] {
    errno = code;
    ThrowErrno("cannot make", "/some/where");
  });
}

TEST(DurableFile, OnlyAFullDiskIsNoSpace) {
  ExpectFor(ENOSPC, ErrorCode::kNoSpace, "write_failed");
  ExpectFor(EDQUOT, ErrorCode::kNoSpace, "write_failed");
  ExpectFor(EFBIG, ErrorCode::kNoSpace, "write_failed");
  ExpectFor(EACCES, ErrorCode::kReadOnly, "permission_denied");
  ExpectFor(EPERM, ErrorCode::kReadOnly, "permission_denied");
  ExpectFor(EROFS, ErrorCode::kReadOnly, "read_only_file_system");
  ExpectFor(EMFILE, ErrorCode::kUnavailable, "too_many_open_files");
  ExpectFor(ENFILE, ErrorCode::kUnavailable, "too_many_open_files");
  ExpectFor(EIO, ErrorCode::kInternal, "io_error");
}

}  // namespace
}  // namespace pliant
