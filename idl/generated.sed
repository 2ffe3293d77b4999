# What fastddsgen generates, mended (CMakeLists.txt beside this file). All of it is called in threads of Fast DDS' own, with
# samples that anybody can send, and nothing catches an exception there: it would end the program.
# It lets most of Fast CDR's exceptions through, such as that of an unknown encapsulation. Caught, the sample is left out.
s/exception::NotEnoughMemoryException/exception::Exception/
# The key of a sample is written into a buffer for strings of 255 bytes, and a longer one throws. So it is one that grows.
/FastBuffer fastbuffer(reinterpret_cast<char\*>(m_keyBuffer),$/{
N
s/FastBuffer fastbuffer(.*);/FastBuffer fastbuffer;/
}
s/m_md5.update(m_keyBuffer,/m_md5.update(reinterpret_cast<unsigned char*>(fastbuffer.getBuffer()),/
s/handle->value\[i\] = m_keyBuffer\[i\];/handle->value[i] = i < ser.getSerializedDataLength() ? static_cast<unsigned char>(fastbuffer.getBuffer()[i]) : 0;/
