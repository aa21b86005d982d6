// A map that was saved and loaded is the same map; a file that is not whole is refused.
// Longer than most files: each of these for every method.
#include "mapper/map_file.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "core/files.h"
#include "core/limits.h"
#include "mapper/store/byte_stream.h"
#include "mapper/store/section_file.h"
#include "mapper/store/volume_store.h"
#include "mapper/voxel_inspection.h"
#include "tests/core/temp_folder.h"
#include "tests/mapper/compare_maps.h"
#include "tests/mapper/every_method.h"
#include "tests/mapper/map_snapshot.h"

namespace tsdfpp {
namespace {

using reference::MakePose;
using test::TempFolder;

class MapFile : public EveryMethodTest {
 protected:
  static LoadedMap Loaded(const std::string& bytes) {
    auto loaded = MapFromBytes(bytes, "map.tsdf");
    EXPECT_TRUE(loaded.has_value()) << loaded.error().message;
    return std::move(*loaded);
  }
};
TSDFPP_FOR_EVERY_VOXEL_METHOD(MapFile);

MappedRun SomeRun() {
  MappedRun run;
  run.sequence = "toys";
  run.objects = {{kBackground, "background", ""}, {kBrick, "brick", "toy"}};
  run.poses = "gt";
  run.last_frame = 3;
  run.trajectories[kBrick] = {{1, Pose::Identity()}, {3, MakePose(1, {1, 2, 3}, {4, 5, 6})}};
  return run;
}

TEST_P(MapFile, TheLoadedMapIsTheSavedOneAndStaysSo) {
  MapConfig config = ToyConfig();
  config.confidence_cap = 7;
  const auto saved = DrivenMap(GetParam(), config, 3);
  // A pose that is set and not yet acted on, and one of an object that nobody has seen.
  saved->SetObjectPose(kTray, MakePose(0.2, Eigen::Vector3d::UnitZ(), {0.05, 0.1, 0.03}));
  saved->SetObjectPose(9, MakePose(0.2, Eigen::Vector3d::UnitZ(), {0.05, 0.1, 0.03}));
  const std::string file = MapToBytes(*saved).value();
  const auto loaded = Loaded(file).map;
  EXPECT_EQ(loaded->method(), GetParam());
  EXPECT_EQ(loaded->config(), config);
  EXPECT_EQ(VoxelsOf(*loaded).FindFault(), std::nullopt);
  EXPECT_TRUE(MapToBytes(*loaded).value() == file);
  EXPECT_TRUE(SnapshotOf(*loaded, ToyIds()) == SnapshotOf(*saved, ToyIds()));
  for (int i = 3; i < 6; ++i) {
    for (const auto& map : {saved.get(), loaded.get()}) {
      SetPosesThenFuse(*map, DriveFrame(i));
      if (i == 4) map->Remove(kBall);
      if (i == 4) map->SetObjectPose(9, Pose::Identity());
    }
    ASSERT_TRUE(MapToBytes(*loaded).value() == MapToBytes(*saved).value()) << "frame " << i;
  }
  EXPECT_FALSE(MapToBytes(*loaded).value() == file);
  EXPECT_TRUE(SnapshotOf(*loaded, ToyIds()) == SnapshotOf(*saved, ToyIds()));
  EXPECT_EQ(loaded->Memory().blocks, saved->Memory().blocks);
}

// The same content by another path: blocks come in another order.
TEST_P(MapFile, TheBytesAreThoseOfTheContentAndForAnyThreads) {
  const auto map = DrivenMap(GetParam(), ToyConfig(), 2);
  const std::string file = MapToBytes(*map).value();
  for (const std::size_t threads : {1U, 2U, 4U}) {
    const tbb::global_control control(tbb::global_control::max_allowed_parallelism, threads);
    EXPECT_TRUE(MapToBytes(*DrivenMap(GetParam(), ToyConfig(), 2)).value() == file) << threads;
    EXPECT_TRUE(MapToBytes(*Loaded(file).map).value() == file) << threads;
  }
  EXPECT_TRUE(MapToBytes(*map->Clone()).value() == file);
}

TEST_P(MapFile, AnEmptyMapIsAMap) {
  const auto map = MakeMap(GetParam(), ToyConfig());
  const auto loaded = Loaded(MapToBytes(*map).value()).map;
  EXPECT_TRUE(loaded->Objects().empty());
  SetPosesThenFuse(*map, DriveFrame(0));
  SetPosesThenFuse(*loaded, DriveFrame(0));
  EXPECT_TRUE(MapToBytes(*loaded).value() == MapToBytes(*map).value());
}

TEST_P(MapFile, ARunComesBack) {
  const MappedRun run = SomeRun();
  const auto loaded = Loaded(MapToBytes(*MakeMap(GetParam(), ToyConfig()), &run).value());
  ASSERT_TRUE(loaded.run.has_value());
  EXPECT_EQ(loaded.run->sequence, run.sequence);
  EXPECT_EQ(loaded.run->objects, run.objects);
  EXPECT_EQ(loaded.run->poses, run.poses);
  EXPECT_EQ(loaded.run->last_frame, run.last_frame);
  ASSERT_EQ(loaded.run->trajectories.size(), 1U);
  for (const int frame : {1, 3}) {
    EXPECT_EQ(loaded.run->trajectories.at(kBrick).at(frame).matrix(),
              run.trajectories.at(kBrick).at(frame).matrix());
  }
  EXPECT_EQ(loaded.run->associate, AssociationMode::kGiven);
  EXPECT_FALSE(Loaded(MapToBytes(*loaded.map).value()).run.has_value());
}

// Whose ids the objects have is in the file, too; files of given ids are as they always were.
TEST_P(MapFile, ARunByVotesComesBack) {
  MappedRun run = SomeRun();
  const auto map = MakeMap(GetParam(), ToyConfig());
  const std::string given = MapToBytes(*map, &run).value();
  run.associate = AssociationMode::kVotes;
  const std::string votes = MapToBytes(*map, &run).value();
  EXPECT_NE(votes, given);
  EXPECT_EQ(Loaded(votes).run->associate, AssociationMode::kVotes);
  EXPECT_EQ(Loaded(votes).run->trajectories.size(), 1U);
}

// Of which recording it is, and where its camera was, which may be where no voxel can.
TEST(MapFileNames, ARecordingComesBack) {
  const auto map = MakeMap(Method::kTsdf, ToyConfig());
  MappedRun run = SomeRun();
  const auto loaded = [&] { return MapFromBytes(MapToBytes(*map, &run).value(), "map.tsdf"); };
  EXPECT_FALSE(loaded()->run->recording.has_value());
  run.recording = {{320, 180, 188.1, 188.2, 160, 90.5}, 0x123456789ABCDEF0, std::nullopt};
  EXPECT_EQ(loaded()->run->recording->intrinsics, run.recording->intrinsics);
  EXPECT_EQ(loaded()->run->recording->last_depth, run.recording->last_depth);
  EXPECT_FALSE(loaded()->run->recording->camera.has_value());
  run.recording->camera = {MakePose(1, {1, 2, 3}, {4, 5, 6e5}), MakePose(2, {3, 2, 1}, {7, 8, 9})};
  EXPECT_EQ(loaded()->run->recording->camera->T_WC_given.matrix(),
            run.recording->camera->T_WC_given.matrix());
  EXPECT_EQ(loaded()->run->recording->camera->T_WC.matrix(), run.recording->camera->T_WC.matrix());
  EXPECT_EQ(loaded()->run->associate, AssociationMode::kGiven);
  run.recording->camera->T_WC.translation().x() = 1e8;
  EXPECT_EQ(loaded().error().message,
            "map.tsdf: section 'RUN ' is wrong: the camera is 1e+08 m from the origin along an "
            "axis, expected at most 1e+07");
  run.recording->camera->T_WC = Pose(Eigen::Scaling(2.0));
  EXPECT_NE(loaded().error().message.find("the camera's pose is no rigid motion"),
            std::string::npos);
}

// Names become file names of what is written; the checksums of such a file are right.
TEST(MapFileNames, ObjectsWithNamesThatEscapeAreRefused) {
  const auto map = MakeMap(Method::kTsdf, ToyConfig());
  const auto sentence = [&](const std::vector<ObjectInfo>& objects) {
    MappedRun run = SomeRun();
    run.objects = objects;
    const auto loaded = MapFromBytes(MapToBytes(*map, &run).value(), "map.tsdf");
    return loaded ? std::string() : loaded.error().message;
  };
  EXPECT_EQ(sentence({{1, "brick", "toy"}}), "");
  const std::string begin = "map.tsdf: section 'RUN ' is wrong: its list: object ";
  EXPECT_EQ(
      sentence({{1, "../../pwned", ""}}),
      begin + "1: the name '../../pwned' holds a slash, expected one that can be a file's name");
  for (const std::string& name :
       {std::string(), std::string(".."), std::string("/x"), std::string("a\nb"),
        std::string("\xff"), std::string("a\0b", 3), std::string(300, 'n')}) {
    EXPECT_TRUE(sentence({{1, name, ""}}).starts_with(begin)) << name;
  }
  EXPECT_EQ(sentence({{1, "a", ""}, {1, "b", ""}}), begin + "1: its id is there twice");
  EXPECT_EQ(sentence({{kNoInstance, "a", ""}}),
            begin + "65535: the id 65535 stands for no object, expected one below");
}

TEST(MapFileNames, ARunNamesAllObjectsInPlainText) {
  const auto map = DrivenMap(Method::kTsdfpp, ToyConfig(), 1);
  MappedRun run = SomeRun();
  for (const InstanceId id : map->Objects()) {
    if (id != kBackground && id != kBrick) run.objects.push_back({id, fmt::format("o{}", id), ""});
  }
  ASSERT_TRUE(MapFromBytes(MapToBytes(*map, &run).value(), "map.tsdf").has_value());
  const auto sentence = [&](const MappedRun& wrong) {
    const auto loaded = MapFromBytes(MapToBytes(*map, &wrong).value(), "map.tsdf");
    return loaded ? std::string() : loaded.error().message;
  };
  MappedRun wrong = run;
  wrong.sequence = "\x1b]0;pwned\x07\n";
  EXPECT_TRUE(sentence(wrong).starts_with("map.tsdf: section 'RUN ' is wrong: the sequence's name"))
      << sentence(wrong);
  wrong = run;
  wrong.objects = {{kBackground, "background", ""}};
  EXPECT_EQ(
      sentence(wrong),
      fmt::format("map.tsdf: section 'RUN ' is wrong: object {} of the map is not in its list",
                  kBrick));
}

// What a run says of objects is of objects that it names, up to its last frame; otherwise it is
// neither read nor written.
TEST(MapFileNames, TrajectoriesAreThoseOfTheRunsObjects) {
  const auto map = MakeMap(Method::kTsdf, ToyConfig());
  const test::TempFolder folder;
  const auto sentence = [&](const MappedRun& run) {
    const auto loaded = MapFromBytes(MapToBytes(*map, &run).value(), "map.tsdf");
    EXPECT_EQ(SaveMap(folder / "map.tsdf", *map, &run).has_value(), loaded.has_value());
    return loaded ? std::string() : loaded.error().message;
  };
  EXPECT_EQ(sentence(SomeRun()), "");
  const std::string begin = "map.tsdf: section 'RUN ' is wrong: ";
  MappedRun run = SomeRun();
  // An id that counting on from would wrap to that of the background.
  run.trajectories[kNoInstance] = {{1, Pose::Identity()}};
  EXPECT_EQ(sentence(run), begin + "object 65535 has a trajectory and is not in its list");
  run = SomeRun();
  run.last_frame = 2;
  EXPECT_EQ(sentence(run), begin + fmt::format("the trajectory of object {} goes to frame 3, "
                                               "behind the last one, 2",
                                               kBrick));
}

// Zeros fold to a thousandth: what they unfold to is summed before memory is taken.
TEST(MapFileSize, WhatUnfoldsToTooMuchIsRefused) {
  constexpr std::size_t kBytes = 8U << 20U;
  const std::string file = PackSections({{"ZERO", std::string(kBytes, '\0')}, {"MORE", "x"}});
  EXPECT_LT(file.size(), kBytes / 100);
  Limits limits;
  limits.map_bytes = kBytes;
  SetLimits(limits);
  const auto over = UnpackSections(file, "map.tsdf");
  limits.map_bytes = kBytes + 1;
  SetLimits(limits);
  const auto within = UnpackSections(file, "map.tsdf");
  SetLimits({});
  ASSERT_FALSE(over.has_value());
  EXPECT_EQ(over.error().message,
            "map.tsdf: 8388609 bytes of a map once it is unfolded, over the limit of 8388608 "
            "(TSDFPP_LIMITS=map_bytes=... raises it)");
  ASSERT_TRUE(within.has_value());
  EXPECT_EQ(within->at("ZERO").size(), kBytes);
  EXPECT_EQ(within->at("MORE"), "x");
}

// A block in memory is larger than in the file.
TEST(MapFileSize, BlocksAreCountedBeforeTheyAreMade) {
  Frame frame = DriveFrame(0);
  for (int v = 0; v < frame.depth.rows; ++v) {
    for (int u = 0; u < frame.depth.cols; ++u) {
      if (u % 8 != 0 || v % 8 != 0) frame.depth.at<float>(v, u) = 0;  // few voxels a block
    }
  }
  const auto map = MakeMap(Method::kVolumes, ToyConfig());
  SetPosesThenFuse(*map, frame);
  const std::string file = MapToBytes(*map).value();
  Limits limits;
  std::int64_t raw = 0;
  const auto sections = UnpackSections(file, "map.tsdf").value();
  for (const auto& [name, bytes] : sections) {
    raw += static_cast<std::int64_t>(bytes.size());
  }
  ASSERT_LT(raw, static_cast<std::int64_t>(map->Memory().blocks * sizeof(TsdfBlock)));
  limits.map_bytes = raw;
  SetLimits(limits);
  const auto loaded = MapFromBytes(file, "map.tsdf");
  SetLimits({});
  ASSERT_FALSE(loaded.has_value());
  EXPECT_NE(loaded.error().message.find("its blocks: "), std::string::npos)
      << loaded.error().message;
  EXPECT_TRUE(MapFromBytes(file, "map.tsdf").has_value());
}

// Every byte of a file is under a checksum, so a file that differs in one is refused.
TEST_P(MapFile, EveryFlippedByteIsRefused) {
  const std::string file = MapToBytes(*DrivenMap(GetParam(), ToyConfig(), 1)).value();
  Dice dice(17);
  constexpr int kFlips = 2000;
  for (int i = 0; i < kFlips; ++i) {
    std::string damaged = file;
    // A quarter of them in the header and the first parts, which are small beside the rest.
    const auto size = static_cast<int>(file.size());
    const auto at = static_cast<std::size_t>(dice.Whole(i % 4 == 0 ? 200 : size));
    damaged[at] = static_cast<char>(damaged[at] ^ (1 + dice.Whole(255)));
    const auto loaded = MapFromBytes(damaged, "map.tsdf");
    ASSERT_FALSE(loaded.has_value()) << "byte " << at;
    ASSERT_EQ(loaded.error().kind, ErrorKind::kData);
    ASSERT_EQ(loaded.error().message.rfind("map.tsdf: ", 0), 0U) << loaded.error().message;
  }
}

// Where parts begin and end, within their headers and contents, and everywhere near both ends.
TEST_P(MapFile, EveryTruncationIsRefused) {
  const MappedRun run = SomeRun();
  const std::string file = MapToBytes(*DrivenMap(GetParam(), ToyConfig(), 1), &run).value();
  std::vector<std::size_t> lengths;
  for (std::size_t length = 0; length < 300; ++length) lengths.push_back(length);
  for (std::size_t back = 1; back < 100; ++back) lengths.push_back(file.size() - back);
  Dice dice(23);
  for (int i = 0; i < 200; ++i) {
    lengths.push_back(static_cast<std::size_t>(dice.Whole(static_cast<int>(file.size()))));
  }
  for (std::size_t at = 32; at < file.size();) {  // the parts
    std::uint32_t stored = 0;
    std::memcpy(&stored, &file[at + 8], sizeof(stored));
    for (const std::size_t length : {at, at + 4, at + 15, at + 16, at + 16 + stored / 2}) {
      lengths.push_back(length);
    }
    at += 16 + stored;
  }
  for (const std::size_t length : lengths) {
    const auto loaded = MapFromBytes(file.substr(0, length), "map.tsdf");
    ASSERT_FALSE(loaded.has_value()) << length << " bytes of " << file.size();
  }
  EXPECT_NE(MapFromBytes(file.substr(0, 1000), "map.tsdf").error().message.find("cut short"),
            std::string::npos);
  EXPECT_NE(MapFromBytes(file + "x", "map.tsdf").error().message.find("longer"), std::string::npos);
}

// Content that passes the checksums and was made up: it is refused, or a map in order.
TEST_P(MapFile, MadeUpContentIsRefusedOrInOrder) {
  const MappedRun run = SomeRun();
  auto map = DrivenMap(GetParam(), ToyConfig(), 1);
  const std::string file = MapToBytes(*map, &run).value();
  const auto sections = UnpackSections(file, "map.tsdf");
  ASSERT_TRUE(sections.has_value());
  Dice dice(29);
  int refused = 0;
#ifdef NDEBUG
  constexpr int kRounds = 400;
#else
  constexpr int kRounds = 100;  // each frame looks for faults by itself
#endif
  for (int i = 0; i < kRounds; ++i) {
    Sections changed = *sections;
    auto section = changed.begin();
    std::advance(section, dice.Whole(static_cast<int>(changed.size())));
    std::string& bytes = section->second;
    if (bytes.empty()) continue;
    const auto size = static_cast<int>(bytes.size());
    const auto at = static_cast<std::size_t>(dice.Whole(i % 2 == 0 ? std::min(size, 400) : size));
    if (dice.Whole(8) == 0) {
      bytes.resize(at);
    } else {
      bytes[at] = static_cast<char>(bytes[at] ^ (1 + dice.Whole(255)));
    }
    auto loaded = MapFromBytes(PackSections(changed), "map.tsdf");
    if (!loaded) {
      ++refused;
      ASSERT_EQ(loaded.error().kind, ErrorKind::kData) << loaded.error().message;
      continue;
    }
    ASSERT_EQ(VoxelsOf(*loaded->map).FindFault(), std::nullopt) << "round " << i;
    SetPosesThenFuse(*loaded->map, DriveFrame(1));
    EXPECT_FALSE(loaded->map->SceneMesh().triangles.empty());
  }
  EXPECT_GT(refused, kRounds / 20);
}

// The checksums are right, the poses rigid; but where the voxels would be is not where their
// objects were born.
TEST(MapFileErrors, ALatticeThatIsNotTheOneAtBirthIsRefused) {
  const Pose moved = MakePose(0.4, Eigen::Vector3d::UnitZ(), {0.3, 0, 0});
  const auto error_of = [&](Method method, const std::optional<Pose>& birth) {
    const auto map = DrivenMap(method, ToyConfig(), 2);
    Sections sections = UnpackSections(MapToBytes(*map).value(), "map.tsdf").value();
    ByteReader bytes(sections.at("VOLS"));
    ObjectVolumes volumes = LoadVolumes(bytes, ToyConfig()).value();
    volumes.at(kBrick).T_WO_birth = birth;
    volumes.at(kBrick).T_WO = moved;
    sections.at("VOLS").clear();
    SaveVolumes(volumes, sections.at("VOLS"));
    const auto loaded = MapFromBytes(PackSections(sections), "map.tsdf");
    if (loaded) return std::string();
    EXPECT_EQ(loaded.error().kind, ErrorKind::kData);
    return loaded.error().message;
  };
  for (const Method method : {Method::kTsdfpp, Method::kTsdfppLiteral}) {
    EXPECT_EQ(error_of(method, std::nullopt), "") << MethodName(method);
    for (const Pose& birth : {moved, Pose::Identity()}) {
      EXPECT_EQ(
          error_of(method, birth),
          "map.tsdf: its map is wrong: object 1 has a lattice of its own, expected the world's")
          << MethodName(method);
    }
  }
  for (const Method method : {Method::kTsdfppAnchored, Method::kVolumes}) {
    EXPECT_EQ(error_of(method, Pose::Identity()), "") << MethodName(method);
    EXPECT_EQ(
        error_of(method, std::nullopt),
        "map.tsdf: its map is wrong: object 1 has a pose and none at birth, so its lattice is "
        "nowhere")
        << MethodName(method);
  }
}

TEST(MapFileErrors, EachIsOneSentenceThatNamesTheFile) {
  const TempFolder folder;
  const auto error_of = [&](const std::string& bytes) {
    const auto path = folder / "a.map";
    EXPECT_TRUE(WriteFile(path, bytes).has_value());
    const auto loaded = LoadMap(path);
    EXPECT_FALSE(loaded.has_value());
    EXPECT_EQ(loaded.error().kind, ErrorKind::kData);
    EXPECT_EQ(loaded.error().message.rfind(path.string(), 0), 0U) << loaded.error().message;
    EXPECT_EQ(loaded.error().message.find('\n'), std::string::npos) << loaded.error().message;
    return loaded.error().message.substr(path.string().size());
  };
  const std::string file = MapToBytes(*MakeMap(Method::kTsdfpp, ToyConfig())).value();
  EXPECT_EQ(error_of(""), ": is not a map file");
  EXPECT_EQ(error_of("ply\nformat binary_little_endian 1.0\n"), ": is not a map file");
  EXPECT_EQ(error_of(file.substr(0, 20)), ": is cut short, within its header");
  std::string newer = file;
  newer[12] = 2;
  EXPECT_EQ(error_of(newer), ": is a map file of version 2, expected 1 or less");
  std::string swapped = file;
  std::swap(swapped[8], swapped[11]);
  std::swap(swapped[9], swapped[10]);
  EXPECT_EQ(error_of(swapped), ": was written by a machine of the other byte order");
  std::string damaged = file;
  damaged[24] = static_cast<char>(damaged[24] ^ 1);
  EXPECT_EQ(error_of(damaged), ": is damaged, its header's checksum is wrong");
  damaged = file;
  damaged.back() = static_cast<char>(damaged.back() ^ 1);
  EXPECT_EQ(error_of(damaged), ": is damaged, the checksum of part 3 of 3 is wrong");

  Sections sections = UnpackSections(file, "").value();
  sections["CONF"] = "method = \"tsdf++\"\nvoxel_m = -1.0\n";
  EXPECT_NE(error_of(PackSections(sections)).find("'voxel_m' is -1"), std::string::npos);
  sections["CONF"] = "method = \"octree\"\n";
  EXPECT_NE(error_of(PackSections(sections)).find("method 'octree' is unknown"), std::string::npos);
  sections["CONF"] = "method = \"tsdf++\"\nwings = 2\n";
  EXPECT_NE(error_of(PackSections(sections)).find("wings"), std::string::npos);
  sections["CONF"] = "method = \"tsdf\"\n";
  EXPECT_EQ(error_of(PackSections(sections)),
            ": has sections 'LIST VOLS', expected 'FIEL LABL POSE' for a map of method tsdf");
  sections.erase("CONF");
  EXPECT_EQ(error_of(PackSections(sections)), ": has no section 'CONF'");
}

TEST(MapFileErrors, AMissingFileAndAFullDisk) {
  const TempFolder folder;
  EXPECT_EQ(LoadMap(folder / "none.map").error().kind, ErrorKind::kData);
  const auto map = MakeMap(Method::kTsdfpp, ToyConfig());
  ASSERT_TRUE(WriteFile(folder / "file", "x").has_value());
  EXPECT_EQ(SaveMap(folder / "file/a.map", *map).error().kind, ErrorKind::kEnvironment);
  ASSERT_TRUE(SaveMap(folder / "new/a.map", *map).has_value());
  EXPECT_TRUE(LoadMap(folder / "new/a.map").has_value());
}

}  // namespace
}  // namespace tsdfpp
