// SPDX-FileCopyrightText: The Pliant authors
// SPDX-License-Identifier: Apache-2.0
#include "server/routes/service.h"

#include <string>
#include <utility>

#include <spdlog/spdlog.h>

#include "descriptor/base/error.h"
#include "index/store/database_url.h"
#include "index/store/open_store.h"

namespace pliant::server {

Service::Service(ServiceOptions service_options)
    : options(std::move(service_options)),
      pool(options.pool),
      backups(options.backup_dir),
      bulk_files(options.bulk),
      fetcher(options.fetch) {}

// Who uses something ends before it: the trainer makes jobs, jobs use the engine and the pool, and
// tell the trainer what they add.
Service::~Service() {
  ready_ = false;
  if (auto_trainer_) auto_trainer_->Stop();
  runner_.reset();
  jobs.reset();
  auto_trainer_.reset();
}

void Service::StartDecoders() {
  if (!options.decoder) {
    spdlog::info("images are decoded inside the server's process (--decoder inside)");
    return;
  }
  try {
    decoders_ = std::make_unique<DecoderPool>(
        *options.decoder, [this](DecoderEnded::Cause cause) { metrics.OnDecoderEnded(cause); });
  } catch (const Error& error) {
    throw Error(error.code(), error.reason(),
                std::string(error.what()) +
                    ". With --decoder inside the server decodes images itself, with less safety.");
  }
  decode_ = [this](Bytes bytes, const DecodeOptions& how) { return decoders_->Decode(bytes, how); };
  if (!decoders_->missing().empty()) {
    spdlog::warn("the system calls of decoders are not limited: {}", decoders_->missing());
  }
}

void Service::Open() {
  StartDecoders();
  EngineOptions engine_options = options.engine;
  engine_options.extraction.decoder = decode_;
  engine_options.loading = [this](double share) { loaded_ = share; };
  engine_options.warn = [](const std::string& failure) { spdlog::error("{}", failure); };
  engine_ = std::make_unique<Engine>(engine_options);
  if (IsSetAside(engine_options.database)) {
    spdlog::info(
        "the originals' directory is not swept: {}.before-restore-... may need what lies there",
        engine_options.database.string());
  } else if (const std::uint64_t swept = engine_->SweepOriginals(); swept > 0) {
    spdlog::info("removed {} files of no image from the originals' directory", swept);
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
                               [this](const std::string& collection) {
                                 if (auto_trainer_) auto_trainer_->OnAdded(collection);
                               }};
  RegisterVocabularyJobs(*runner_, *engine_, pool);
  RegisterImportJobs(*runner_, imports);
  RegisterDemonstrationJob(*runner_, imports);
  backups.RegisterJob(*runner_, *engine_);
  if (options.auto_train) auto_trainer_ = std::make_unique<AutoTrainer>(*engine_, *jobs);
  runner_->Start();
  if (const std::size_t swept = bulk_files.Sweep(*jobs); swept > 0) {
    spdlog::info("removed {} imports that were never received as a whole", swept);
  }
  loaded_ = 1;
  ready_ = true;
}

std::string CollectionOf(Service& service, const Request& request) {
  return service.engine().CollectionName(request.captures.at("c"));
}

}  // namespace pliant::server
