// Arrays as MAT-files and NPZ files, byte by byte where a format says so; tests/python reads them by NumPy and SciPy.
#include "record/array_file.hpp"

#include "support.hpp"

namespace fork1s::testing {
namespace {

std::uint32_t Word(const std::string& bytes, std::size_t at) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i)
    word |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + i])) << 8 * i;
  return word;
}

double Number(const std::string& bytes, std::size_t at) {
  return std::bit_cast<double>(std::uint64_t{Word(bytes, at)} | std::uint64_t{Word(bytes, at + 4)} << 32);
}

MatrixX TwoByThree() {
  MatrixX A(2, 3);
  A << 1, 2, 3, 4, 5, 6;
  return A;
}

TEST(ArrayFile, MatFileHoldsAMatrixByColumns) {
  Folder folder;
  ASSERT_TRUE(SaveMatFile({{"A", ToNumberArray(TwoByThree())}}, folder / "a.mat"));
  const std::string bytes = Bytes(folder / "a.mat");
  EXPECT_EQ(bytes.substr(0, 19), "MATLAB 5.0 MAT-file");
  EXPECT_EQ(bytes.substr(124, 4), std::string("\x00\x01IM", 4));
  EXPECT_EQ(Word(bytes, 128), 14u);                 // a matrix
  EXPECT_EQ(Word(bytes, 132), bytes.size() - 136);  // of all that is left
  EXPECT_EQ(Word(bytes, 144), 6u);                  // of doubles
  EXPECT_EQ(Word(bytes, 160), 2u);                  // rows
  EXPECT_EQ(Word(bytes, 164), 3u);                  // columns
  EXPECT_EQ(Word(bytes, 172), 1u);                  // letters of its name
  EXPECT_EQ(bytes[176], 'A');
  EXPECT_EQ(Word(bytes, 188), 48u);
  for (int i = 0; i < 6; ++i)
    EXPECT_EQ(Number(bytes, 192 + 8 * static_cast<std::size_t>(i)), TwoByThree()(i % 2, i / 2)) << i;
}

TEST(ArrayFile, NpzFileHoldsAMatrixByRows) {
  Folder folder;
  ASSERT_TRUE(SaveNpzFile({{"A", ToNumberArray(TwoByThree())}}, folder / "a.npz"));
  const std::string bytes = Bytes(folder / "a.npz");
  const std::size_t begin = 30 + 5;  // local header and the name A.npy
  EXPECT_EQ(bytes.substr(begin, 8), std::string("\x93NUMPY\x01\x00", 8));
  EXPECT_NE(bytes.find("{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }"), std::string::npos);
  const std::size_t data = bytes.find('\n', begin) + 1;
  EXPECT_EQ((data - begin) % 64, 0u);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(Number(bytes, data + 8 * static_cast<std::size_t>(i)), i + 1) << i;
}

TEST(ArrayFile, BytesThatAreNoUtf8BecomeReplacementLetters) {
  Folder folder;
  // Overlong, a surrogate, above the last code, cut off.
  for (const char* damaged : {"\xC0\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xE2\x82"}) {
    ASSERT_TRUE(SaveMatFile({{"t", std::vector<std::string>{damaged}}}, folder / "t.mat"));
    EXPECT_EQ(Bytes(folder / "t.mat").find(damaged), std::string::npos);
    EXPECT_NE(Bytes(folder / "t.mat").find("\xEF\xBF\xBD\xEF\xBF\xBD"), std::string::npos);
    ASSERT_TRUE(SaveNpzFile({{"t", std::vector<std::string>{damaged}}}, folder / "t.npz"));
    EXPECT_NE(Bytes(folder / "t.npz").find(std::string("\xFD\xFF\0\0\xFD\xFF\0\0", 8)), std::string::npos);
  }
}

TEST(ArrayFile, WhatIsTooLargeForItsFormatIsRefused) {
  Folder folder;
  std::vector<std::string> texts(6000);
  texts[0].assign(100000, 'x');  // of 6000 texts of that length, 4 bytes a letter
  const auto saved = SaveNpzFile({{"t", texts}}, folder / "t.npz");
  ASSERT_FALSE(saved);
  EXPECT_EQ(saved.error().code, ErrorCode::kFile);
  EXPECT_NE(saved.error().Text().find("t.npz: would be larger than 2 GB"), std::string::npos)
      << saved.error().Text();
  EXPECT_FALSE(std::filesystem::exists(folder / "t.npz"));
  EXPECT_TRUE(SaveMatFile({{"t", texts}}, folder / "t.mat"));
}

TEST(ArrayFile, OnlyFilesOfItsKindAreReplaced) {
  Folder folder;
  const std::vector<NamedArray> arrays = {{"A", ToNumberArray(TwoByThree())}};
  WriteBytes(folder / "notes", "remember the milk\n");
  EXPECT_FALSE(SaveMatFile(arrays, folder / "notes"));
  EXPECT_FALSE(SaveNpzFile(arrays, folder / "notes"));
  EXPECT_EQ(Bytes(folder / "notes"), "remember the milk\n");
  ASSERT_TRUE(SaveMatFile(arrays, folder / "a"));
  EXPECT_FALSE(SaveNpzFile(arrays, folder / "a"));
  EXPECT_TRUE(SaveMatFile(arrays, folder / "a"));
}

}  // namespace
}  // namespace fork1s::testing
