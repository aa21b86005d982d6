// One writer a format, for ExportSequence (sequence/export.h).
#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "sequence/export.h"
#include "sequence/integer_images.h"

namespace tsdfpp {

// Writes into a folder that is its own. Frames come in order and have the sizes that their
// intrinsics say.
class DatasetWriter {
 public:
  virtual ~DatasetWriter() = default;
  virtual Expected<void> Add(const Frame& frame) = 0;
  // After the last frame; adds to `report.left_out`.
  virtual Expected<void> Finish(ExportReport& report) = 0;
  virtual double depth_units_per_m() const = 0;

  const DepthLoss& loss() const { return loss_; }

 protected:
  DepthLoss loss_;
};

// `models` may be empty.
std::unique_ptr<DatasetWriter> MakeTumWriter(const SequenceInfo& info,
                                             std::filesystem::path folder);
std::unique_ptr<DatasetWriter> MakeKlgWriter(const SequenceInfo& info,
                                             std::filesystem::path folder);
std::unique_ptr<DatasetWriter> MakeSevenScenesWriter(const SequenceInfo& info,
                                                     std::filesystem::path folder);
std::unique_ptr<DatasetWriter> MakeBopWriter(const SequenceInfo& info, std::filesystem::path folder,
                                             std::vector<TrueModel> models);

// Writes what an encoder returned, or passes its error on.
Expected<void> WriteEncoded(const std::filesystem::path& path, const Expected<std::string>& bytes);

}  // namespace tsdfpp
