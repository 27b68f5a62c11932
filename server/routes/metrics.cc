// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/metrics.h"

#include <ctime>
#include <exception>
#include <fstream>
#include <mutex>
#include <set>
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
// Collections with series of their own. The others share one, whose name no collection can have.
constexpr std::size_t kMostCollections = 100;
constexpr const char* kOtherCollections = "(other)";

const prometheus::Histogram::BucketBoundaries kSeconds = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60};

// From the resident pages (proc(5), statm); 0 if the file cannot be read.
double ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  double total = 0;
  double resident = 0;
  file >> total >> resident;
  return file ? resident * static_cast<double>(sysconf(_SC_PAGESIZE)) : 0;
}

}  // namespace

std::optional<EngineStats> StoreFigures::Get() {
  if (!on_server_) return engine_.Stats();
  std::unique_lock lock(mutex_);
  if (!asked_.valid() && Clock::now() - answered_at_ > kFresh) {
    asked_ = std::async(std::launch::async, [this] { return engine_.Stats(); }).share();
  }
  const std::shared_future<EngineStats> asked = asked_;
  lock.unlock();
  if (asked.valid()) asked.wait_for(kMostWait);
  lock.lock();
  if (asked_.valid() && asked_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    try {
      stats_ = std::exchange(asked_, {}).get();
    } catch (const std::exception& error) {
      spdlog::warn("cannot read the statistics of the database: {}", error.what());
    }
    answered_at_ = Clock::now();
  }
  return stats_;
}

class Metrics::Impl {
  using Counters = prometheus::Family<prometheus::Counter>;
  using GaugeFamily = prometheus::Family<prometheus::Gauge>;
  using Histograms = prometheus::Family<prometheus::Histogram>;

 public:
  prometheus::Registry registry;
  Counters& requests =
      MakeCounters("pliant_http_requests_total", "Requests by route, method and status");
  Histograms& request_seconds =
      MakeHistograms("pliant_http_request_seconds",
                     "From the first byte of a request to the last of its answer, by route");
  Counters& part_requests =
      MakeCounters("pliant_part_requests_total",
                   "Requests to servers that hold parts of the index, by part and outcome");
  Histograms& part_seconds = MakeHistograms(
      "pliant_part_seconds", "Answered requests to servers that hold parts of the index, by part");
  Histograms& stage_seconds =
      MakeHistograms("pliant_stage_seconds", "Stages of searching and of adding an image");
  Counters& decoders_ended =
      MakeCounters("pliant_decoders_ended_total", "Child processes that ended, by cause");
  Counters& searches = MakeCounters("pliant_searches_total", "Searches by collection");
  Counters& images_added = MakeCounters("pliant_images_added_total",
                                        "Images added or replaced by uploads, by collection");

  void CountIn(Counters& family, const std::string& collection) {
    const std::lock_guard lock(mutex_);
    if (collections_.size() < kMostCollections) collections_.insert(collection);
    family.Add({{"collection", collections_.contains(collection) ? collection : kOtherCollections}})
        .Increment();
  }

  void Observe(const char* operation, const char* stage, double ms) {
    stage_seconds.Add({{"operation", operation}, {"stage", stage}}, kSeconds).Observe(ms / 1000);
  }

  void ObserveExtraction(const char* operation, const ExtractionTimings& timings) {
    Observe(operation, "decode", timings.decode_ms);
    Observe(operation, "detect", timings.detect_ms);
    Observe(operation, "describe", timings.describe_ms);
  }

  void SetLoad(const MetricsNow& now) {
    auto& queue = Gauges("pliant_queue_length", "Tasks that wait for a core, by lane");
    Set(queue, {{"lane", "search"}}, now.load.waiting_searches);
    Set(queue, {{"lane", "upload"}}, now.load.waiting_uploads);
    Set(queue, {{"lane", "background"}}, now.load.waiting_background);
    if (now.jobs) {
      auto& jobs = Gauges("pliant_jobs", "Background jobs on record, by state");
      for (const JobState state : {JobState::kQueued, JobState::kRunning, JobState::kDone,
                                   JobState::kFailed, JobState::kCancelled}) {
        const auto count = now.jobs->find(state);
        Set(jobs, {{"state", JobStateName(state)}}, count == now.jobs->end() ? 0 : count->second);
      }
    }
    Set("pliant_busy_cores", "Cores in use by tasks and jobs", now.load.busy_cores);
    Set("pliant_decoders", "Child processes that decode images", now.decoders);
    Set("pliant_disk_free_bytes", "Free space on the disk of the database", now.disk_free_bytes);
    Set("process_resident_memory_bytes", "Memory of the process", ResidentBytes());
    Set("process_cpu_seconds_total", "Processor time of the process",
        static_cast<double>(std::clock()) / CLOCKS_PER_SEC);
  }

  void SetStats(const EngineStats& stats) {
    Set("pliant_images", "Images in the index", stats.images);
    Set("pliant_objects", "Objects in the index", stats.objects);
    Set("pliant_database_bytes", "Size of the database", stats.database_bytes);
    Set("pliant_index_bytes", "Size of the index in memory", stats.index_bytes);
    Set("pliant_vocabulary_words", "Words of the active vocabulary of the default collection",
        stats.vocabulary ? stats.vocabulary->words : 0);
    if (stats.vocabulary) SetVocabulary(*stats.vocabulary);
    if (stats.server) SetServer(*stats.server);
  }

  void SetInfo(const EngineStats& stats) {
    Set(Gauges("pliant_info", "1, with the version, the descriptor and the model's id"),
        {{"version", PLIANT_VERSION}, {"descriptor", stats.descriptor}, {"model", stats.model_id}},
        1);
  }

 private:
  Counters& MakeCounters(const char* name, const char* help) {
    return prometheus::BuildCounter().Name(name).Help(help).Register(registry);
  }
  Histograms& MakeHistograms(const char* name, const char* help) {
    return prometheus::BuildHistogram().Name(name).Help(help).Register(registry);
  }
  // Makes the family, or finds the one of that name.
  GaugeFamily& Gauges(const char* name, const char* help) {
    return prometheus::BuildGauge().Name(name).Help(help).Register(registry);
  }
  template <typename Number>
  void Set(GaugeFamily& family, const prometheus::Labels& labels, Number value) {
    family.Add(labels).Set(static_cast<double>(value));
  }
  template <typename Number>
  void Set(const char* name, const char* help, Number value) {
    Set(Gauges(name, help), {}, value);
  }

  // Of a database on PostgreSQL.
  void SetServer(const DatabaseServerRecord& server) {
    Set("pliant_database_connections", "Open connections to the database", server.connections);
    Set("pliant_database_connection_waits_total",
        "Times that all reading connections were in use since the start", server.connection_waits);
    Set("pliant_feed_lag", "Changes of the database that the index in memory lacks", server.behind);
    auto& lag =
        Gauges("pliant_replication_lag_seconds", "Delay of the slowest standby behind the primary");
    if (server.replication_lag_s) {
      Set(lag, {}, *server.replication_lag_s);
    } else {
      lag.Remove(&lag.Add({}));
    }
  }

  // One series at a time: that of the active vocabulary.
  void SetVocabulary(const VocabularyRecord& record) {
    auto& family =
        Gauges("pliant_vocabulary_info",
               "1, with id, words and method of the active vocabulary of the default collection");
    const std::lock_guard lock(mutex_);
    prometheus::Gauge& now = family.Add({{"id", std::to_string(record.id)},
                                         {"words", std::to_string(record.words)},
                                         {"method", record.origin.method}});
    if (vocabulary_ != nullptr && vocabulary_ != &now) family.Remove(vocabulary_);
    vocabulary_ = &now;
    now.Set(1);
  }

  std::mutex mutex_;  // guards what follows
  prometheus::Gauge* vocabulary_ = nullptr;
  std::set<std::string> collections_;  // with series of their own
};

// Every cause begins at 0, so that the first end of a process shows as a change.
Metrics::Metrics() : impl_(std::make_unique<Impl>()) {
  for (std::size_t i = 0; i < kDecoderCauses; ++i) {
    impl_->decoders_ended.Add({{"cause", DecoderCauseName(static_cast<DecoderEnded::Cause>(i))}});
  }
}
Metrics::~Metrics() = default;

void Metrics::OnRequest(const RequestRecord& record) {
  // Only methods of routes: clients must not create series.
  const bool routed = record.route != "-";
  impl_->requests
      .Add({{"route", record.route},
            {"method", routed ? record.method : "-"},
            {"code", std::to_string(record.status)}})
      .Increment();
  impl_->request_seconds.Add({{"route", record.route}}, kSeconds).Observe(record.seconds);
}

void Metrics::OnSearch(const SearchTimings& timings, const std::string& collection) {
  impl_->CountIn(impl_->searches, collection);
  impl_->ObserveExtraction("search", timings.extraction);
  impl_->Observe("search", "quantize", timings.quantize_ms);
  impl_->Observe("search", "rank", timings.rank_ms);
  impl_->Observe("search", "verify", timings.verify_ms);
  impl_->Observe("search", "database", timings.database_ms);
}

void Metrics::OnAdd(const AddTimings& timings, const std::string& collection) {
  impl_->CountIn(impl_->images_added, collection);
  impl_->ObserveExtraction("add", timings.extraction);
  impl_->Observe("add", "quantize", timings.quantize_ms);
  impl_->Observe("add", "database", timings.database_ms);
}

void Metrics::OnDecoderEnded(DecoderEnded::Cause cause) {
  impl_->decoders_ended.Add({{"cause", DecoderCauseName(cause)}}).Increment();
}

void Metrics::OnPeer(std::size_t part, PeerOutcome outcome, double seconds) {
  const std::string number = std::to_string(part + 1);
  const char* const name = kPeerOutcomeNames[static_cast<int>(outcome)];
  impl_->part_requests.Add({{"part", number}, {"outcome", name}}).Increment();
  if (outcome != PeerOutcome::kAnswered) return;
  impl_->part_seconds.Add({{"part", number}}, kSeconds).Observe(seconds);
}

std::string Metrics::Text(const MetricsNow& now) {
  impl_->SetLoad(now);
  impl_->SetStats(now.stats != nullptr ? *now.stats : EngineStats());
  if (now.stats != nullptr) impl_->SetInfo(*now.stats);
  return prometheus::TextSerializer().Serialize(impl_->registry.Collect());
}

}  // namespace pliant::server
