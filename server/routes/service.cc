// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/service.h"

#include <functional>
#include <string>
#include <utility>

#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
#include "index/store/database_url.h"
#include "index/store/open_store.h"
#include "server/jobs/self_tests.h"

namespace pliant::server {

constexpr int kJpegQuality = 82;  // of thumbnails

Service::Service(ServiceOptions service_options)
    : options(std::move(service_options)),
      pool(options.pool),
      backups(options.backup_dir),
      bulk_files(options.bulk),
      fetcher(options.fetch) {}

// Users end first: the trainer creates jobs; jobs use the engine and the pool, and tell the trainer
// what they add.
Service::~Service() {
  ready_ = false;
  if (auto_trainer_) auto_trainer_->Stop();
  runner_.reset();
  jobs.reset();
  auto_trainer_.reset();
}

void Service::StartDecoders() {
  if (!options.decoder) {
    spdlog::info("the server decodes images in its own process (--decoder inside)");
    return;
  }
  try {
    decoders_ = std::make_unique<DecoderPool>(
        *options.decoder, [this](DecoderEnded::Cause cause) { metrics.OnDecoderEnded(cause); });
  } catch (const Error& error) {
    throw Error(
        error.code(), error.reason(),
        std::string(error.what()) +
            ". With --decoder inside the server decodes images in its own process, less safely.");
  }
  decode_ = [this](Bytes bytes, const DecodeOptions& how) { return decoders_->Decode(bytes, how); };
  if (!decoders_->missing().empty()) {
    spdlog::warn("the system calls of decoders are not restricted: {}", decoders_->missing());
  }
}

void Service::Open() {
  StartDecoders();
  EngineOptions engine_options = options.engine;
  engine_options.extraction.decoder = decode_;
  engine_options.loading = [this](double share) { loaded_ = share; };
  engine_options.warn = [](const std::string& failure) { spdlog::error("{}", failure); };
  if (!options.peers.empty()) {
    peers_ = std::make_unique<Peers>(options.peers, std::bind_front(&Metrics::OnPeer, &metrics));
    engine_options.part_servers = [this] { return peers_->Current(); };
  }
  engine_ = std::make_unique<Engine>(engine_options);
  if (IsSetAside(engine_options.database)) {
    spdlog::info("unused originals are kept: {}.before-restore-... may need them",
                 engine_options.database.string());
  } else if (const std::uint64_t swept = engine_->SweepOriginals(); swept > 0) {
    spdlog::info("removed {} unused files from the originals' directory", swept);
  }
  figures_ = std::make_unique<StoreFigures>(engine_.get(),
                                            IsDatabaseUrl(engine_options.database.string()));
  store_ = OpenServiceStore(options.engine.database);
  jobs = std::make_unique<JobStore>(
      *store_, [this](const JobStatus& job) { RemoveBodyOf(job, bulk_files); });
  runner_ = std::make_unique<JobRunner>(*jobs);
  const ImportServices imports{*jobs,
                               *engine_,
                               pool,
                               fetcher,
                               bulk_files,
                               options.import_dir,
                               engine_options.extraction.decode.max_bytes,
                               [this](const std::string& collection) { OnAdded(collection); }};
  RegisterVocabularyJobs(*runner_, *engine_, pool);
  RegisterSelfTestJob(*runner_, *engine_, pool, decode_);
  RegisterImportJobs(*runner_, imports);
  RegisterDemonstrationJob(*runner_, imports);
  backups.RegisterJob(*runner_, *engine_);
  if (options.auto_train) auto_trainer_ = std::make_unique<AutoTrainer>(*engine_, *jobs);
  runner_->Start();
  if (const std::size_t swept = bulk_files.Sweep(*jobs); swept > 0) {
    spdlog::info("removed {} incomplete imports", swept);
  }
  loaded_ = 1;
  ready_ = true;
}

std::string Service::Shrink(Bytes encoded, int longer_side_px) {
  DecodeOptions decode = options.engine.extraction.decode;
  decode.max_side_px = longer_side_px;
  decode.max_bytes = static_cast<std::int64_t>(encoded.size());
  decode.colour = true;
  std::vector<std::uint8_t> jpeg;
  pool.Run(WorkerPool::Lane::kSearch,
           [&](int) { jpeg = EncodeJpeg(decode_(encoded, decode).image, kJpegQuality); });
  return {jpeg.begin(), jpeg.end()};
}

std::string CollectionOf(Service& service, const Request& request) {
  return service.engine().CollectionName(request.captures.at("c"));
}

}  // namespace pliant::server
