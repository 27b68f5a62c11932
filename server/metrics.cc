// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

namespace pliant::server {

namespace {

const prometheus::Histogram::BucketBoundaries kSeconds = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60};

}  // namespace

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
          .Name("pliant_search_stage_seconds")
          .Help("Stages of a search")
          .Register(registry);
  prometheus::Family<prometheus::Gauge>& gauges_queue =
      prometheus::BuildGauge()
          .Name("pliant_queue_length")
          .Help("Tasks that wait for a core, by lane")
          .Register(registry);
  prometheus::Gauge& busy_cores = Gauge("pliant_busy_cores", "Cores in use by tasks and jobs");
  prometheus::Gauge& images = Gauge("pliant_images", "Pictures in the index");
  prometheus::Gauge& objects = Gauge("pliant_objects", "Objects in the index");
  prometheus::Gauge& words = Gauge("pliant_vocabulary_words", "Words of the active vocabulary");
  prometheus::Gauge& vocabulary = Gauge("pliant_vocabulary_id", "Id of the active vocabulary");
  prometheus::Gauge& database_bytes = Gauge("pliant_database_bytes", "Size of the database file");
  prometheus::Gauge& index_bytes = Gauge("pliant_index_bytes", "Size of the index in memory");
  prometheus::Family<prometheus::Gauge>& info = prometheus::BuildGauge()
                                                    .Name("pliant_info")
                                                    .Help("Version, descriptor and model")
                                                    .Register(registry);

 private:
  prometheus::Gauge& Gauge(const std::string& name, const std::string& help) {
    return prometheus::BuildGauge().Name(name).Help(help).Register(registry).Add({});
  }
};

Metrics::Metrics() : impl_(std::make_unique<Impl>()) {}
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
  const auto observe = [&](const char* stage, double ms) {
    impl_->stage_seconds.Add({{"stage", stage}}, kSeconds).Observe(ms / 1000);
  };
  observe("decode", timings.extraction.decode_ms);
  observe("detect", timings.extraction.detect_ms);
  observe("describe", timings.extraction.describe_ms);
  observe("quantize", timings.quantize_ms);
  observe("rank", timings.rank_ms);
  observe("verify", timings.verify_ms);
}

std::string Metrics::Text(const WorkerPool::Load& load, const EngineStats* stats) {
  impl_->gauges_queue.Add({{"lane", "search"}}).Set(static_cast<double>(load.waiting_searches));
  impl_->gauges_queue.Add({{"lane", "upload"}}).Set(static_cast<double>(load.waiting_uploads));
  impl_->busy_cores.Set(load.busy_cores);
  if (stats != nullptr) {
    impl_->images.Set(static_cast<double>(stats->images));
    impl_->objects.Set(static_cast<double>(stats->objects));
    impl_->database_bytes.Set(static_cast<double>(stats->database_bytes));
    impl_->index_bytes.Set(static_cast<double>(stats->index_bytes));
    if (stats->vocabulary) {
      impl_->words.Set(static_cast<double>(stats->vocabulary->words));
      impl_->vocabulary.Set(static_cast<double>(stats->vocabulary->id));
    }
    impl_->info
        .Add({{"version", PLIANT_VERSION},
              {"descriptor", stats->descriptor},
              {"model", stats->model_id}})
        .Set(1);
  }
  return prometheus::TextSerializer().Serialize(impl_->registry.Collect());
}

}  // namespace pliant::server
