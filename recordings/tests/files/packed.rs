//! Claim: chunks that others packed with zstd or lz4 are read (`tests/packed.py` made the files).

use recordings::read::MessageReader;
use std::io::Cursor;

const FILES: [(&str, &[u8]); 3] = [
    ("zstd", include_bytes!("../fixtures/zstd.mcap")),
    ("lz4", include_bytes!("../fixtures/lz4.mcap")),
    ("none", include_bytes!("../fixtures/no_chunks.mcap")),
];

#[test]
fn packed_chunks_are_read() {
    for (packing, file) in FILES {
        let mut reader = MessageReader::open(Cursor::new(file)).unwrap();
        let mut found = Vec::new();
        while let Some(raw) = reader.next_message().unwrap() {
            assert_eq!(
                (raw.channel.topic.as_str(), raw.channel.schema.as_str()),
                ("/text", "std_msgs/msg/String")
            );
            found.push((raw.log_time_ns, String::from_utf8(raw.data.to_vec()).unwrap()));
        }
        let expected: Vec<_> = (0..200).map(|i| (i, format!("message {i} ").repeat(20))).collect();
        assert_eq!(found, expected, "{packing}");
    }
}
