//! The compressors of Zarr, so that a chunk never inflates beyond its own size.
//!
//! The decoders of the crate `zarrs` give whatever a payload holds, and allocate what its header says. The crate takes codecs from its caller in
//! place of its own: these are asked with the size that a chunk has at that step, also for the chunks of nested shards.

use std::borrow::Cow;
use std::sync::{Arc, Once};

use zarrs::array::codec::api::{
    BytesRepresentation, BytesToBytesCodecTraits, Codec, CodecError, CodecMetadataOptions, CodecOptions,
    CodecRuntimePluginV2, CodecRuntimePluginV3, CodecTraits, CodecTraitsV2, CodecTraitsV3,
    PartialDecoderCapability, PartialEncoderCapability, RecommendedConcurrency, register_codec_v2,
    register_codec_v3,
};
use zarrs::array::codec::{BloscCodec, Bz2Codec, GzipCodec, ZlibCodec, ZstdCodec};
use zarrs::metadata::Configuration;
use zarrs::plugin::{ExtensionAliases, ExtensionName, ZarrVersion, ZarrVersion2, ZarrVersion3};

use crate::bounded_decoder::Coder;

/// Bytes of a step whose size no codec bounds.
const MOST_UNBOUNDED_BYTES: u64 = 1 << 30;

/// A codec of `zarrs` whose decoder is replaced.
#[derive(Debug)]
struct Bounded {
    codec: Arc<dyn BytesToBytesCodecTraits>,
    coder: Coder,
}

/// Puts the bounded codecs in the place of those of `zarrs`, for the whole process. To be called before an array is opened.
pub(crate) fn register() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        replace::<GzipCodec>(Coder::Gzip);
        replace::<ZlibCodec>(Coder::Zlib);
        replace::<ZstdCodec>(Coder::Zstd);
        replace::<Bz2Codec>(Coder::Bzip2);
        replace::<BloscCodec>(Coder::Blosc);
    });
}

fn replace<T>(coder: Coder)
where
    T: ExtensionAliases<ZarrVersion2>
        + ExtensionAliases<ZarrVersion3>
        + CodecTraitsV2
        + CodecTraitsV3
        + 'static,
{
    let bounded = move |codec| match codec {
        Codec::BytesToBytes(codec) => Codec::BytesToBytes(Arc::new(Bounded { codec, coder })),
        other => other,
    };
    register_codec_v2(CodecRuntimePluginV2::new(
        <T as ExtensionAliases<ZarrVersion2>>::matches_name,
        move |metadata| <T as CodecTraitsV2>::create(metadata).map(bounded),
    ));
    register_codec_v3(CodecRuntimePluginV3::new(
        <T as ExtensionAliases<ZarrVersion3>>::matches_name,
        move |metadata| <T as CodecTraitsV3>::create(metadata).map(bounded),
    ));
}

impl ExtensionName for Bounded {
    fn name(&self, version: ZarrVersion) -> Option<Cow<'static, str>> {
        self.codec.name(version)
    }
}

impl CodecTraits for Bounded {
    fn as_any(&self) -> &dyn std::any::Any {
        self
    }

    fn configuration(&self, version: ZarrVersion, options: &CodecMetadataOptions) -> Option<Configuration> {
        self.codec.configuration(version, options)
    }

    fn partial_decoder_capability(&self) -> PartialDecoderCapability {
        PartialDecoderCapability { partial_read: false, partial_decode: false }
    }

    fn partial_encoder_capability(&self) -> PartialEncoderCapability {
        PartialEncoderCapability { partial_encode: false }
    }
}

impl BytesToBytesCodecTraits for Bounded {
    fn into_dyn(self: Arc<Self>) -> Arc<dyn BytesToBytesCodecTraits> {
        self
    }

    fn recommended_concurrency(
        &self,
        decoded: &BytesRepresentation,
    ) -> Result<RecommendedConcurrency, CodecError> {
        self.codec.recommended_concurrency(decoded)
    }

    fn encoded_representation(&self, decoded: &BytesRepresentation) -> BytesRepresentation {
        self.codec.encoded_representation(decoded)
    }

    fn encode<'a>(&self, plain: Cow<'a, [u8]>, options: &CodecOptions) -> Result<Cow<'a, [u8]>, CodecError> {
        self.codec.encode(plain, options)
    }

    fn decode<'a>(
        &self,
        stored: Cow<'a, [u8]>,
        decoded: &BytesRepresentation,
        _options: &CodecOptions,
    ) -> Result<Cow<'a, [u8]>, CodecError> {
        let most = match *decoded {
            BytesRepresentation::FixedSize(bytes) => bytes,
            // Bounds of compressed data: other writers add comments and blocks of their own.
            BytesRepresentation::BoundedSize(bytes) => bytes.saturating_mul(2).saturating_add(1 << 16),
            BytesRepresentation::UnboundedSize => MOST_UNBOUNDED_BYTES,
        };
        self.coder.decode(&stored, most).map(Cow::Owned).map_err(CodecError::Other)
    }
}
