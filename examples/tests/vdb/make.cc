// Writes small OpenVDB and NanoVDB files of several kinds into this folder, and what is in them, as the libraries read it, into values.txt.
// On Debian 12:
//   apt-get install libopenvdb-dev libnanovdb-dev libnanovdb-tools libboost-dev libboost-iostreams-dev libtbb-dev libimath-dev libblosc-dev zlib1g-dev
//   g++ -std=c++17 make.cc -o make -lopenvdb -ltbb -lImath-3_1 -lz -lblosc -lboost_iostreams && ./make > values.txt && gzip -n9 *.vdb *.nvdb
// A line of values.txt: file, grid, first and last active voxel, CRC-32 of the values (f32) of that box and three voxels around it, x fastest,
// their sum, and the images of the voxels (0, 0, 0) and (1, 2, 3) in the world.
#include <openvdb/openvdb.h>
#define NANOVDB_USE_ZIP
#define NANOVDB_USE_BLOSC
#include <nanovdb/util/IO.h>
#include <cstdlib>
#include <cstdio>
#include <zlib.h>
#include <cmath>
using namespace openvdb;
static float value(int x, int y, int z) {
    // A ball with ripples.
    float r = std::sqrt(float((x - 7) * (x - 7) + (y - 8) * (y - 8) + (z - 13) * (z - 13)));
    if (r > 6.5f) return 0.f;
    return 0.25f + 0.5f * (1.f - r / 6.5f) + 0.125f * float((x * 7 + y * 13 + z * 5) & 3);
}
template <class G> typename G::Ptr cloud(const char* name) {
    auto grid = G::create(0);
    auto acc = grid->getAccessor();
    for (int x = 0; x < 24; ++x) for (int y = 0; y < 24; ++y) for (int z = 0; z < 24; ++z) {
        float v = value(x, y, z);
        if (v > 0) acc.setValue(Coord(x, y, z), v);
    }
    grid->setName(name);
    grid->setGridClass(GRID_FOG_VOLUME);
    return grid;
}
// Tiles, inactive values of two kinds, negative coordinates, an affine map.
FloatGrid::Ptr odd(const char* name) {
    auto grid = FloatGrid::create(0);
    grid->fill(CoordBBox(Coord(-8, 0, 0), Coord(-1, 7, 7)), 0.5f, true);  // a leaf's worth of a tile
    grid->fill(CoordBBox(Coord(-128, -128, -128), Coord(-121, -121, -121)), 2.0f, true);
    auto acc = grid->getAccessor();
    for (int i = 0; i < 20; ++i) acc.setValue(Coord(100 + i, 3 * i % 11, 2), 0.125f * (i + 1));
    acc.setValueOff(Coord(101, 50, 2), 0.75f);
    acc.setValueOff(Coord(102, 50, 2), 0.375f);
    acc.setValue(Coord(103, 50, 2), 1.5f);
    acc.setValueOff(Coord(101, 60, 2), 0.75f);
    acc.setValue(Coord(103, 60, 2), 1.25f);
    grid->setName(name);
    math::Mat4d m(0.5, 0.1, 0., 0., 0., 0.25, 0., 0., 0., 0.05, 0.75, 0., 3., 4., 5., 1.);
    grid->setTransform(math::Transform::createLinearTransform(m));
    return grid;
}
template <class A> void tell(const char* file, const std::string& name, const char* type, const GridBase& g, const CoordBBox& box, const A& acc) {
    // Values of the box with a border of 3, x fastest.
    uLong crc = crc32(0, nullptr, 0);
    double sum = 0;
    Coord lo = box.min().offsetBy(-3), hi = box.max().offsetBy(3);
    for (int z = lo.z(); z <= hi.z(); ++z) for (int y = lo.y(); y <= hi.y(); ++y) for (int x = lo.x(); x <= hi.x(); ++x) {
        float v = float(acc.getValue(Coord(x, y, z)));
        sum += v;
        crc = crc32(crc, (const Bytef*)&v, 4);
    }
    auto o = g.transform().indexToWorld(Vec3d(0, 0, 0)), a = g.transform().indexToWorld(Vec3d(1, 2, 3));
    printf("%s %s %d %d %d %d %d %d %08lx %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", file, name.c_str(), box.min().x(), box.min().y(), box.min().z(), box.max().x(), box.max().y(), box.max().z(), crc, sum,
        o[0], o[1], o[2], a[0], a[1], a[2]);
}
void save(const char* file, uint32_t compression, const GridPtrVec& grids) {
    io::File f(file);
    f.setCompression(compression);
    f.write(grids);
    f.close();
}
void show(const char* file) {
    io::File f(file);
    f.open();
    for (auto it = f.beginName(); it != f.endName(); ++it) {
        auto base = f.readGrid(*it);
        if (auto g = gridPtrCast<FloatGrid>(base)) tell(file, *it, "float", *g, g->evalActiveVoxelBoundingBox(), g->getConstAccessor());
        if (auto g = gridPtrCast<DoubleGrid>(base)) tell(file, *it, "double", *g, g->evalActiveVoxelBoundingBox(), g->getConstAccessor());
    }
}
template <class T> void present(const std::string& file) {
    for (auto& handle : nanovdb::io::readGrids(file)) {
        auto grid = handle.grid<T>();
        auto acc = grid->getAccessor();
        auto box = grid->indexBBox();
        uLong crc = crc32(0, nullptr, 0);
        double sum = 0;
        for (int z = box.min()[2] - 3; z <= box.max()[2] + 3; ++z) for (int y = box.min()[1] - 3; y <= box.max()[1] + 3; ++y) for (int x = box.min()[0] - 3; x <= box.max()[0] + 3; ++x) {
            float v = acc.getValue(nanovdb::Coord(x, y, z));
            sum += v;
            crc = crc32(crc, (const Bytef*)&v, 4);
        }
        auto o = grid->indexToWorld(nanovdb::Vec3d(0, 0, 0)), a = grid->indexToWorld(nanovdb::Vec3d(1, 2, 3));
        printf("%s %s %d %d %d %d %d %d %08lx %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", file.c_str(), grid->gridName(), box.min()[0], box.min()[1], box.min()[2],
            box.max()[0], box.max()[1], box.max()[2], crc, sum, o[0], o[1], o[2], a[0], a[1], a[2]);
    }
}
int main() {
    initialize();
    auto scaled = math::Transform::createLinearTransform(0.1);
    auto a = cloud<FloatGrid>("density");
    a->setTransform(scaled);
    save("none.vdb", io::COMPRESS_ACTIVE_MASK, {a});
    save("all.vdb", io::COMPRESS_NONE, {a});
    save("zip.vdb", io::COMPRESS_ZIP | io::COMPRESS_ACTIVE_MASK, {a});
    save("blosc.vdb", io::COMPRESS_BLOSC | io::COMPRESS_ACTIVE_MASK, {a});
    save("blosc_all.vdb", io::COMPRESS_BLOSC, {a});
    auto h = cloud<FloatGrid>("density");
    h->setTransform(scaled->copy());
    h->setSaveFloatAsHalf(true);
    save("half.vdb", io::COMPRESS_BLOSC | io::COMPRESS_ACTIVE_MASK, {h});
    save("half_zip.vdb", io::COMPRESS_ZIP | io::COMPRESS_ACTIVE_MASK, {h});
    auto d = cloud<DoubleGrid>("density");
    auto t = math::Transform::createLinearTransform(0.25);
    t->postTranslate(Vec3d(1, 2, 3));
    d->setTransform(t);
    save("double.vdb", io::COMPRESS_BLOSC | io::COMPRESS_ACTIVE_MASK, {d});
    // Several grids: an instance of the first elsewhere, one that is no density, an odd one.
    auto instance = a->copyGrid();
    instance->setName("again");
    auto moved = math::Transform::createLinearTransform(0.2);
    moved->preRotate(0.5, math::Y_AXIS);
    moved->postTranslate(Vec3d(-1, 0, 2));
    instance->setTransform(moved);
    auto velocity = Vec3SGrid::create();
    velocity->getAccessor().setValue(Coord(1, 2, 3), Vec3s(1, 2, 3));
    velocity->setName("velocity");
    save("several.vdb", io::COMPRESS_BLOSC | io::COMPRESS_ACTIVE_MASK, {velocity, a, instance, odd("odd")});
    save("odd_zip.vdb", io::COMPRESS_ZIP | io::COMPRESS_ACTIVE_MASK, {odd("odd")});
    auto low = cloud<FloatGrid>("low");
    save("low.vdb", io::COMPRESS_BLOSC | io::COMPRESS_ACTIVE_MASK, {low, odd("odd")});
    for (auto f : {"none.vdb", "all.vdb", "zip.vdb", "blosc.vdb", "blosc_all.vdb", "half.vdb", "half_zip.vdb", "double.vdb", "several.vdb", "odd_zip.vdb"}) show(f);
    for (std::string kind : {"none", "zip", "blosc", "fp4", "fp8", "fp16", "fpN"}) {
        bool odd = kind == "none" || kind == "fpN";
        std::string file = kind + ".nvdb";
        std::string option = kind == "none" ? "" : "--" + kind;
        std::string command = "nanovdb_convert -f " + option + (odd ? " low.vdb " : " none.vdb ") + file;
        if (std::system(command.c_str())) return 1;
        if (kind == "fp4") present<nanovdb::Fp4>(file);
        else if (kind == "fp8") present<nanovdb::Fp8>(file);
        else if (kind == "fp16") present<nanovdb::Fp16>(file);
        else if (kind == "fpN") present<nanovdb::FpN>(file);
        else present<float>(file);
    }
    std::remove("low.vdb");
}
