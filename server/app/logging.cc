// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/app/logging.h"

#include <cmath>

#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include "server/http/json.h"

namespace pliant::server {

namespace {

constexpr const char* kTextPattern = "%Y-%m-%dT%H:%M:%S.%eZ %l %v";
constexpr const char* kJsonPattern = R"({"time":"%Y-%m-%dT%H:%M:%S.%eZ","level":"%l",%*})";

// The message as members of a JSON object: as they are when it is an object already.
class JsonMembers : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& out) override {
    const std::string text(message.payload.data(), message.payload.size());
    const std::string members = text.starts_with("{\"event\":")
                                    ? text.substr(1, text.size() - 2)
                                    : "\"message\":" + ToText(Json(text));
    out.append(members.data(), members.data() + members.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<JsonMembers>();
  }
};

bool json_lines = false;  // set once, before any thread

std::string RequestText(const RequestRecord& record) {
  return fmt::format("{} {} {} {} in={} out={} ms={:.1f} from={} id={}{}{}{}", record.method,
                     record.path, record.status, record.route, record.bytes_in, record.bytes_out,
                     record.seconds * 1000, record.remote_address, record.id,
                     record.key_id.empty() ? "" : " key=" + record.key_id,
                     record.code.empty() ? "" : " code=" + record.code,
                     record.internal.empty() ? "" : " cause=" + record.internal);
}

std::string RequestJson(const RequestRecord& record) {
  Json json = {{"event", "request"},
               {"method", record.method},
               {"path", record.path},
               {"status", record.status},
               {"route", record.route},
               {"bytes_in", record.bytes_in},
               {"bytes_out", record.bytes_out},
               {"ms", std::round(record.seconds * 1e4) / 10},
               {"client", record.remote_address},
               {"request_id", record.id}};
  if (!record.key_id.empty()) json["key"] = record.key_id;
  if (!record.code.empty()) json["code"] = record.code;
  if (!record.internal.empty()) json["cause"] = record.internal;
  return ToText(json);
}

}  // namespace

void StartLog(const ServerOptions& options) {
  json_lines = options.log_format == "json";
  auto formatter = std::make_unique<spdlog::pattern_formatter>(spdlog::pattern_time_type::utc);
  formatter->add_flag<JsonMembers>('*').set_pattern(json_lines ? kJsonPattern : kTextPattern);
  auto logger = spdlog::stderr_logger_mt("pliant-server");
  logger->set_formatter(std::move(formatter));
  logger->set_level(spdlog::level::from_str(options.log_level));
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(logger));
}

void LogRequest(const RequestRecord& record) {
  const auto level = record.status >= 500 ? spdlog::level::warn : spdlog::level::info;
  if (!spdlog::should_log(level)) return;
  spdlog::log(level, "{}", json_lines ? RequestJson(record) : RequestText(record));
}

}  // namespace pliant::server
