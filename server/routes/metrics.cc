// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/metrics.h"

#include <ctime>
#include <exception>
#include <fstream>
#include <mutex>
#include <utility>

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

namespace pliant::server {
namespace {

constexpr std::chrono::seconds kFresh{5};
constexpr std::chrono::milliseconds kMostWait{1000};

const prometheus::Histogram::BucketBoundaries kSeconds = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60};

// Resident pages (proc(5), statm); 0 where that cannot be read.
double ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  double total = 0;
  double resident = 0;
  file >> total >> resident;
  return file ? resident * static_cast<double>(sysconf(_SC_PAGESIZE)) : 0;
}

double CpuSeconds() {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + static_cast<double>(used.tv_nsec) * 1e-9;
}

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

class Metrics::Impl {
 public:
  prometheus::Registry registry;
  prometheus::Family<prometheus::Counter>& requests =
      prometheus::BuildCounter()
          .Name("pliant_http_requests_total")
          .Help("Requests by route, method and status")
          .Register(registry);
  prometheus::Family<prometheus::Histogram>& request_seconds =
      prometheus::BuildHistogram()
          .Name("pliant_http_request_seconds")
          .Help("From the first byte of a request to the last of its answer, by route")
          .Register(registry);
  prometheus::Family<prometheus::Histogram>& stage_seconds =
      prometheus::BuildHistogram()
          .Name("pliant_stage_seconds")
          .Help("Stages of searching and of adding an image")
          .Register(registry);
  prometheus::Family<prometheus::Gauge>& queue =
      Gauges("pliant_queue_length", "Tasks that wait for a core, by lane");
  prometheus::Family<prometheus::Gauge>& jobs =
      Gauges("pliant_jobs", "Background jobs on record, by state");
  prometheus::Gauge& busy_cores = Gauge("pliant_busy_cores", "Cores in use by tasks and jobs");
  prometheus::Gauge& decoders = Gauge("pliant_decoders", "Child processes that decode images");
  prometheus::Family<prometheus::Counter>& decoders_ended =
      prometheus::BuildCounter()
          .Name("pliant_decoders_ended_total")
          .Help("Child processes that ended, by cause")
          .Register(registry);
  prometheus::Gauge& images = Gauge("pliant_images", "Images in the index");
  prometheus::Gauge& objects = Gauge("pliant_objects", "Objects in the index");
  prometheus::Gauge& words =
      Gauge("pliant_vocabulary_words", "Words of the active vocabulary of the default collection");
  prometheus::Gauge& database_bytes = Gauge("pliant_database_bytes", "Size of the database");
  prometheus::Gauge& disk_free_bytes =
      Gauge("pliant_disk_free_bytes", "Free space on the disk of the database");
  // Of a database on PostgreSQL.
  prometheus::Family<prometheus::Gauge>& connections =
      Gauges("pliant_database_connections", "Open connections to the database");
  prometheus::Family<prometheus::Gauge>& connection_waits =
      Gauges("pliant_database_connection_waits_total",
             "Times that all reading connections were in use since the start");
  prometheus::Family<prometheus::Gauge>& feed_lag =
      Gauges("pliant_feed_lag", "Changes of the database that the index in memory lacks");
  prometheus::Family<prometheus::Gauge>& replication_lag =
      Gauges("pliant_replication_lag_seconds", "Delay of the slowest standby behind the primary");
  prometheus::Gauge& index_bytes = Gauge("pliant_index_bytes", "Size of the index in memory");
  prometheus::Gauge& resident_bytes =
      Gauge("process_resident_memory_bytes", "Memory of the process");
  prometheus::Gauge& cpu_seconds =
      Gauge("process_cpu_seconds_total", "Processor time of the process");
  prometheus::Family<prometheus::Gauge>& info =
      Gauges("pliant_info", "1, with the version, the descriptor and the model's id");
  prometheus::Family<prometheus::Gauge>& vocabulary_info =
      Gauges("pliant_vocabulary_info",
             "1, with id, words and method of the active vocabulary of the default collection");
  std::mutex mutex;  // guards vocabulary
  prometheus::Gauge* vocabulary = nullptr;

  void Observe(const char* operation, const char* stage, double ms) {
    stage_seconds.Add({{"operation", operation}, {"stage", stage}}, kSeconds).Observe(ms / 1000);
  }

  void SetServer(const DatabaseServerRecord& server) {
    connections.Add({}).Set(static_cast<double>(server.connections));
    connection_waits.Add({}).Set(static_cast<double>(server.connection_waits));
    feed_lag.Add({}).Set(static_cast<double>(server.behind));
    prometheus::Gauge& lag = replication_lag.Add({});
    if (server.replication_lag_s) {
      lag.Set(*server.replication_lag_s);
    } else {
      replication_lag.Remove(&lag);
    }
  }

  // One series at a time: the vocabulary that was active before is none any more.
  void SetVocabulary(const VocabularyRecord& record) {
    const std::lock_guard lock(mutex);
    prometheus::Gauge& now = vocabulary_info.Add({{"id", std::to_string(record.id)},
                                                  {"words", std::to_string(record.words)},
                                                  {"method", record.origin.method}});
    if (vocabulary != nullptr && vocabulary != &now) vocabulary_info.Remove(vocabulary);
    vocabulary = &now;
    vocabulary->Set(1);
  }

 private:
  prometheus::Family<prometheus::Gauge>& Gauges(const std::string& name, const std::string& help) {
    return prometheus::BuildGauge().Name(name).Help(help).Register(registry);
  }
  prometheus::Gauge& Gauge(const std::string& name, const std::string& help) {
    return Gauges(name, help).Add({});
  }
};

// Every cause is counted from 0, so that the first one is seen as a change.
Metrics::Metrics() : impl_(std::make_unique<Impl>()) {
  for (std::size_t i = 0; i < kDecoderCauses; ++i) {
    impl_->decoders_ended.Add({{"cause", DecoderCauseName(static_cast<DecoderEnded::Cause>(i))}});
  }
}
Metrics::~Metrics() = default;

void Metrics::OnRequest(const RequestRecord& record) {
  // The method only where it is one of a route: clients must not be able to make new series.
  const bool routed = record.route != "-";
  impl_->requests
      .Add({{"route", record.route},
            {"method", routed ? record.method : "-"},
            {"code", std::to_string(record.status)}})
      .Increment();
  impl_->request_seconds.Add({{"route", record.route}}, kSeconds).Observe(record.seconds);
}

void Metrics::OnSearch(const SearchTimings& timings) {
  impl_->Observe("search", "decode", timings.extraction.decode_ms);
  impl_->Observe("search", "detect", timings.extraction.detect_ms);
  impl_->Observe("search", "describe", timings.extraction.describe_ms);
  impl_->Observe("search", "quantize", timings.quantize_ms);
  impl_->Observe("search", "rank", timings.rank_ms);
  impl_->Observe("search", "verify", timings.verify_ms);
  impl_->Observe("search", "database", timings.database_ms);
}

void Metrics::OnAdd(const AddTimings& timings) {
  impl_->Observe("add", "decode", timings.extraction.decode_ms);
  impl_->Observe("add", "detect", timings.extraction.detect_ms);
  impl_->Observe("add", "describe", timings.extraction.describe_ms);
  impl_->Observe("add", "quantize", timings.quantize_ms);
  impl_->Observe("add", "database", timings.database_ms);
}

void Metrics::OnDecoderEnded(DecoderEnded::Cause cause) {
  impl_->decoders_ended.Add({{"cause", DecoderCauseName(cause)}}).Increment();
}

std::string Metrics::Text(const MetricsNow& now) {
  Impl& m = *impl_;
  m.queue.Add({{"lane", "search"}}).Set(static_cast<double>(now.load.waiting_searches));
  m.queue.Add({{"lane", "upload"}}).Set(static_cast<double>(now.load.waiting_uploads));
  m.queue.Add({{"lane", "background"}}).Set(static_cast<double>(now.load.waiting_background));
  m.busy_cores.Set(now.load.busy_cores);
  m.decoders.Set(static_cast<double>(now.decoders));
  m.resident_bytes.Set(ResidentBytes());
  m.cpu_seconds.Set(CpuSeconds());
  for (const JobState state : {JobState::kQueued, JobState::kRunning, JobState::kDone,
                               JobState::kFailed, JobState::kCancelled}) {
    if (!now.jobs) break;  // they keep their values
    const auto count = now.jobs->find(state);
    m.jobs.Add({{"state", JobStateName(state)}})
        .Set(count == now.jobs->end() ? 0 : static_cast<double>(count->second));
  }
  if (now.stats != nullptr) {
    const EngineStats& stats = *now.stats;
    m.images.Set(static_cast<double>(stats.images));
    m.objects.Set(static_cast<double>(stats.objects));
    m.database_bytes.Set(static_cast<double>(stats.database_bytes));
    m.disk_free_bytes.Set(static_cast<double>(now.disk_free_bytes));
    m.index_bytes.Set(static_cast<double>(stats.index_bytes));
    if (stats.server) m.SetServer(*stats.server);
    if (stats.vocabulary) {
      m.words.Set(static_cast<double>(stats.vocabulary->words));
      m.SetVocabulary(*stats.vocabulary);
    }
    m.info
        .Add({{"version", PLIANT_VERSION},
              {"descriptor", stats.descriptor},
              {"model", stats.model_id}})
        .Set(1);
  }
  return prometheus::TextSerializer().Serialize(m.registry.Collect());
}

}  // namespace pliant::server
