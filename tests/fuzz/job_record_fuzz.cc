// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
// Jobs as they are stored. An input is the parameters' JSON on the first line, the state on the
// second, and the report's JSON behind them.
#include "server/jobs/job_store.h"
#include "tests/fuzz/refusal.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using pliant::fuzz::Require;
  std::string_view text = pliant::fuzz::TextOf({data, size});
  pliant::JobRecord record;
  record.parameters = pliant::fuzz::TakeLine(text);
  record.state = pliant::fuzz::TakeLine(text);
  record.report = text;
  const pliant::server::JobStatus status = pliant::server::FromRecord(record);
  Require(status.parameters.is_object(), "parameters are an object");
  const pliant::JobRecord stored = pliant::server::ToRecord(status, record.owner);
  const pliant::JobRecord again =
      pliant::server::ToRecord(pliant::server::FromRecord(stored), stored.owner);
  Require(again.report == stored.report && again.parameters == stored.parameters &&
              again.state == stored.state,
          "what is stored is what was read");
  return 0;
}
