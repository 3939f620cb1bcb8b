// Files that appear whole or not at all, and never over what they should not replace.
#include "record/output_file.hpp"

#include <sys/stat.h>

#include "support.hpp"

namespace fork1s::testing {
namespace {

namespace fs = std::filesystem;
constexpr FileKind kPlain{"a plain text", "text"};

std::size_t FilesIn(const Folder& folder) {
  return static_cast<std::size_t>(
      std::distance(fs::directory_iterator(folder / ""), fs::directory_iterator()));
}

TEST(OutputFile, TakesItsPlaceWhenKept) {
  Folder folder;
  WriteBytes(folder / "out", "text before");
  fs::permissions(folder / "out", fs::perms(0640));
  {
    auto out = OutputFile::Create(folder / "out", kPlain);
    ASSERT_TRUE(out) << out.error().Text();
    WriteBytes(out->part(), "text after");
    EXPECT_EQ(Bytes(folder / "out"), "text before");
    ASSERT_TRUE(out->Commit());
    EXPECT_EQ(Bytes(folder / "out"), "text after");
  }
  EXPECT_EQ(Bytes(folder / "out"), "text after");
  EXPECT_EQ(fs::status(folder / "out").permissions(), fs::perms(0640));
  EXPECT_EQ(FilesIn(folder), 1u);
}

TEST(OutputFile, LeavesNothingBehindUnlessKept) {
  Folder folder;
  WriteBytes(folder / "out", "text before");
  for (const char* name : {"out", "new"}) ASSERT_TRUE(OutputFile::Create(folder / name, kPlain));
  EXPECT_EQ(Bytes(folder / "out"), "text before");
  EXPECT_EQ(FilesIn(folder), 1u);
}

TEST(OutputFile, RefusesFilesOfAnotherKind) {
  Folder folder;
  WriteBytes(folder / "model.xml", "<mujoco/>");
  WriteBytes(folder / "short", "te");
  for (const char* name : {"model.xml", "short"}) {
    const auto out = OutputFile::Create(folder / name, kPlain);
    ASSERT_FALSE(out);
    EXPECT_EQ(out.error().code, ErrorCode::kFile);
    EXPECT_NE(out.error().message.find("a plain text"), std::string::npos) << out.error().message;
  }
  WriteBytes(folder / "empty", "");
  EXPECT_TRUE(OutputFile::Create(folder / "empty", kPlain));
}

TEST(OutputFile, OneWriterAtATime) {
  Folder folder;
  auto first = OutputFile::Create(folder / "out", kPlain);
  ASSERT_TRUE(first);
  ASSERT_TRUE(first->Commit());
  const auto second = OutputFile::Create(folder / "out", kPlain);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().message.find("another run"), std::string::npos) << second.error().message;
  first = OutputFile::Create(folder / "other", kPlain);  // the first one lets go
  EXPECT_TRUE(OutputFile::Create(folder / "out", kPlain));
}

TEST(OutputFile, TwoThatBeginTogetherAreToldApart) {
  Folder folder;
  auto first = OutputFile::Create(folder / "out", kPlain),
       second = OutputFile::Create(folder / "out", kPlain);
  ASSERT_TRUE(first && second);
  WriteBytes(first->part(), "text of the first");
  ASSERT_TRUE(first->Commit());
  EXPECT_FALSE(second->Commit());
  EXPECT_EQ(Bytes(folder / "out"), "text of the first");
}

TEST(OutputFile, SymbolicLinksStay) {
  Folder folder;
  WriteBytes(folder / "file", "text");
  fs::create_symlink("file", folder / "link");
  fs::create_symlink(folder / "new", folder / "dangling");
  ASSERT_TRUE(WriteFile(folder / "link", kPlain, "text after"));
  ASSERT_TRUE(WriteFile(folder / "dangling", kPlain, "text of the new"));
  EXPECT_TRUE(fs::is_symlink(folder / "link"));
  EXPECT_TRUE(fs::is_symlink(folder / "dangling"));
  EXPECT_EQ(Bytes(folder / "file"), "text after");
  EXPECT_EQ(Bytes(folder / "new"), "text of the new");
}

TEST(OutputFile, FoldersDevicesAndPipes) {
  Folder folder;
  fs::create_directory(folder / "folder");
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  for (const std::string& path : {folder / "folder", folder / "pipe", std::string("/dev/full"),
                                  std::string(""), folder / "no/such/folder", folder / "folder/"}) {
    const auto out = OutputFile::Create(path, kPlain);
    ASSERT_FALSE(out) << path;
    EXPECT_EQ(out.error().code, ErrorCode::kFile);
  }
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  EXPECT_TRUE(WriteFile("/dev/null", kPlain, "text"));
  EXPECT_FALSE(WriteFile("/dev/full", kPlain, "text"));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
}

TEST(OutputFile, TwoRecordersCannotShareAFile) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  auto first = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(first);
  const auto second = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kFile);
  Record(simulation, *first, 3);
  ASSERT_TRUE(first->Finish());
  EXPECT_TRUE(Recording::Open(folder / "run.h5"));
  EXPECT_TRUE(Recorder::Create(folder / "run.h5", simulation));  // it has ended
}

}  // namespace
}  // namespace fork1s::testing
